"""Identification: what a fit minimises, finds, knows and does not know."""
