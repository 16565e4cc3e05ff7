"""Imposed flows, one a module."""
