"""Identification: unknowns of a model found from a campaign, and how well they are known.

A fit takes `estimation` for its problem and search, `statistics` for intervals, `diagnostics` for
the verdict.
"""

import lazy_loader

GONE = {
    "UserModel": (
        "give a fit a Machine(model, numbers), or the Model itself; rate, substeps, begin and "
        "given stand at the top level of its file, or in ModelSetup"
    ),
    "MachineModel": "give a fit a swashplate.BlackBox instead of an object with simulate",
}
"""Names that there were, and what to write instead."""

# names are imported when they are first used: most callers need few of the modules
_imported, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    """A name of this package; one that is gone says what to write instead."""
    if name in GONE:
        # of an AttributeError 'from ... import' would make a sentence of its own
        raise ImportError(f"there is no {name} any more: {GONE[name]}")
    return _imported(name)
