"""Marches of a model: one simulation, many at once, their derivatives and residuals."""
