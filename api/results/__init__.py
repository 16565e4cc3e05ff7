"""Stored runs and boundaries in the form in which clients read them."""
