"""Models whose equations are changed while they are used: cells of a notebook."""

import sys
from weakref import WeakKeyDictionary

from swashplate.machine.code_generation.functions import forget_generated
from swashplate.machine.declaration import forget_replacements
from swashplate.machine.keeping import key_of, roles_of
from swashplate.machine.model import Model

_last_keys: WeakKeyDictionary[Model, str] = WeakKeyDictionary()
"""Keys of models as they were last used in an interactive session."""


def renew(model: Model) -> None:
    """Forget what was generated if a cell that a model's equations reach was run again.

    Only in an interactive session, for equations that were written in it.
    """
    if not (hasattr(sys, "ps1") or "ipykernel" in sys.modules):
        return
    roles = [role for part in model.parts for role in roles_of(part) if role is not None]
    if not any(role.__module__ == "__main__" for role in roles):
        return
    key = key_of.__wrapped__(model)
    if _last_keys.setdefault(model, key) != key:
        key_of.cache_clear()
        forget_generated()
        forget_replacements()
        _last_keys[model] = key
