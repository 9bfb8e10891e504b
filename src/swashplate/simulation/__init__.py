"""Marching the equations through time: plain, with sensitivities, many sets at once."""
