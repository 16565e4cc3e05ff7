"""The service: jobs over HTTP, the workers that run them, and a web page to look at what is stored.

The parts, from the lowest to the highest. Each imports only parts that stand before it, and `ensemble` and
`solver`; a test checks this.

1. `settings`: limits and places, from environment variables
2. `database`: tables of jobs and tokens, on SQLite or PostgreSQL
3. `http`: errors, limits, headers, pages and tags of HTTP, without any knowledge of jobs or runs
4. `auth`: tokens and who makes a request
5. `jobs`: submissions, their cost, and the queue
6. `results`: stored runs and boundaries as clients read them
7. `worker`: carries out jobs with `mpirun` or Slurm
8. `client`: the same from Python
9. `routes`: what the service answers, one module for each resource, and the web page (`static`)
10. `app`: all routes and the middleware in one application
11. `serve`: the server process
12. `commands`: `ensemble serve`, `ensemble worker`, `ensemble token`
"""
