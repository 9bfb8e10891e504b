"""Capabilities of a drive, its limits, and the effects of changes."""

import lazy_loader

# names are imported when they are first used: most callers need few of the modules
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
