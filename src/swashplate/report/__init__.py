"""Figures of simulations and drives: the only package that imports plotting."""
