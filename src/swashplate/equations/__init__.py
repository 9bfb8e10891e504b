"""How an equation becomes code: checked, compiled, differentiated and kept.

An equation is written once, as a value; this package knows nothing of drives.
"""

from swashplate.equations.cache import generated, kernel
from swashplate.equations.derivatives import declared, derive
from swashplate.equations.derived import Derived
from swashplate.equations.equation import closure, closure_hash, equation, inlined, source
from swashplate.equations.library import soft_threshold
from swashplate.equations.primitives import interpolate, repeated, root

__all__ = [
    "Derived",
    "closure",
    "closure_hash",
    "declared",
    "derive",
    "equation",
    "generated",
    "inlined",
    "interpolate",
    "kernel",
    "repeated",
    "root",
    "soft_threshold",
    "source",
]
