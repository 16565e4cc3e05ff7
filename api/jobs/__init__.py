"""Jobs: submissions, their limits and cost, and the queue that workers lease from."""
