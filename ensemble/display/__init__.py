"""What people and programs see while work goes on and when it is done: progress, and tables of results."""
