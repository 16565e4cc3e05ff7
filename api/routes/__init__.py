"""What the service answers: one module for each resource, and the web page."""
