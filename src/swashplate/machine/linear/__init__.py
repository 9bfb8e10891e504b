"""Small motions: linear models at an operating point, and frequency responses large and small.

Of any model with numbers; what is special to a drive is in `swashplate.drive`.
"""

import lazy_loader

# names are imported when they are first used
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
