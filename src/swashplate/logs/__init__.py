"""Reading log files: one format a module, columns by name, nothing read that is not asked for.

`open_log` looks into a file, `Log.read` reads columns of it, `read_series` a signal over time in
SI. A file that is damaged or hostile ends in one sentence, and nothing half-read is returned.
"""

import lazy_loader

# names are imported when they are first used: a schema needs few of the modules
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
