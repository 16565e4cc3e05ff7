"""The service: jobs over HTTP, the worker that runs them, and a page to look at what is stored."""
