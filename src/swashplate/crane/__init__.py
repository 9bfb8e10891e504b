"""Cranes: three identified drives, a boom on a moving ship, a load on its rope, and control.

The crane itself stands here; `sea` moves its ship, `closed_loop` runs it, `studies` assess control.
"""

import lazy_loader

# names are imported when they are first used: kinematics by itself needs few of the modules
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
