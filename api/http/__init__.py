"""How the service speaks HTTP: errors, limits, headers, pages and tags. Knows nothing of jobs or runs."""
