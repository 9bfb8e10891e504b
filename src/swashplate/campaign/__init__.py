"""Measured tests: logs in, clean signals out."""
