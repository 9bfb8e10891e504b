"""Identification: unknowns of a model found from a campaign, and how well they are known.

A fit takes `estimation` for its problem and search, `statistics` for intervals, `diagnostics` for
the verdict.
"""

import lazy_loader

# names are imported when they are first used: most callers need few of the modules
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
