"""Figures of simulations and drives: the only package that imports plotting."""

import lazy_loader

# imported when they are first used: most callers draw nothing
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
