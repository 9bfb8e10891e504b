"""A model is equations, a machine a model with its numbers, and every verb a function of a machine.

An equation is written once, as a value. `code_generation` makes code of equations, `marching` runs
machines, `linear` gives their small motions; nothing here knows a drive.
"""

import lazy_loader

# names are imported when they are first used: a model needs equations, and most callers no more
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
