"""Steady states: found by Newton's method, whether they are stable, and how they change with a parameter."""
