"""Parameters: what each is, sets of their values, the rules that these satisfy, and files."""

import lazy_loader

# names are imported when they are first used: a rule loads compiled equations
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
