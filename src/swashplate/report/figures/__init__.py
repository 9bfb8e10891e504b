"""The figures, by name: `matplotlib.figure.Figure` objects in the units that people read.

A ``title`` stands in the place of the words that say what is shown.
"""

import lazy_loader

from swashplate.report.style import save_figure as save_figure

# each imports what it shows, so that nobody waits for what is not drawn
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["save_figure"]
