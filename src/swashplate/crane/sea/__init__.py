"""The sea under a crane: seaways, the ship's motion in them, how often they come, extremes."""

import lazy_loader

# what other packages use besides the names of the package above
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
