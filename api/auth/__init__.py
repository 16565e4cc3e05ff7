"""Tokens, their scopes, and who is asking."""
