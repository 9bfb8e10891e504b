"""Export: a drive, or a user-defined model, where there is no Python."""

import lazy_loader

# names are imported when they are first used
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
