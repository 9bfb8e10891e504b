"""Studies of a crane: many runs or a spectrum, and the assessment that follows from them."""

import lazy_loader

# what other packages use besides the names of the package above
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
