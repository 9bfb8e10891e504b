"""How an equation becomes code, and a machine of equations a model.

An equation is written once, as a value; this package knows nothing of drives. `code_generation`
makes code of equations, `marching` runs models.
"""

import lazy_loader

# names are imported when they are first used: a model needs equations, and most callers no more
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
