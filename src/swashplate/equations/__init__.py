"""How an equation becomes code: checked, compiled, differentiated and kept.

An equation is written once, as a value; this package knows nothing of drives.
"""

from swashplate.equations.adjoints import Derived
from swashplate.equations.cache import generated, kernel
from swashplate.equations.definition import Definition
from swashplate.equations.derivatives import declared, derive
from swashplate.equations.discretise import discretised
from swashplate.equations.equation import closure, closure_hash, equation, inlined, source
from swashplate.equations.jacobian import state_paths
from swashplate.equations.library import soft_threshold
from swashplate.equations.loops import interpolate, repeated, root
from swashplate.equations.model import Model, Tap, join
from swashplate.equations.replacement import replaced
from swashplate.equations.use import Run, instance_of, parameter_paths, sensitivities, simulate
from swashplate.equations.windows import Window

__all__ = [
    "Definition",
    "Derived",
    "Model",
    "Run",
    "Tap",
    "Window",
    "closure",
    "closure_hash",
    "declared",
    "derive",
    "discretised",
    "equation",
    "generated",
    "inlined",
    "instance_of",
    "interpolate",
    "join",
    "kernel",
    "parameter_paths",
    "repeated",
    "replaced",
    "root",
    "sensitivities",
    "simulate",
    "soft_threshold",
    "source",
    "state_paths",
]
