"""Stored runs and boundaries as a client reads them."""
