"""Pages of cranes: a scene that moves, the verdict of an assessment, operability."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
