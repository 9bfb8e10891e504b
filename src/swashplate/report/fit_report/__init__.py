"""The report of a fit or a validation: one HTML file that needs nothing else, figures as files."""

import lazy_loader

# figures need no page and the page no figures: each is imported when it is first used
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
