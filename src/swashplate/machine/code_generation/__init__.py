"""From equations to code: traced into a graph, differentiated, scheduled, printed."""

import lazy_loader

# what other packages use besides the names of the package above
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
