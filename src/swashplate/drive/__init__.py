"""A drive: a model with numbers, from a joystick's voltage to the shaft's speed.

It is simulated, differentiated, marched in batches and one sample at a time, and linearised.
"""

import lazy_loader

# names are imported when they are first used
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
