"""What environment variables say of compiling: where code is kept, for which processor, whether.

Numba, which compiles kernels of the crane and of users, is told the same.
"""

from __future__ import annotations

import os
import sys

CACHE_DIR, CPU, COMPILE = "SWASHPLATE_CACHE_DIR", "SWASHPLATE_CPU", "SWASHPLATE_COMPILE"
"""Folder of compiled code; LLVM's name of the processor that is compiled for; 0: nothing is."""


def obey() -> None:
    """Hand the variables on, before anything is compiled."""
    told = {}
    if folder := os.environ.get(CACHE_DIR):
        told["NUMBA_CACHE_DIR"] = folder
    if processor := os.environ.get(CPU):
        told |= {"NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": ""}
    if os.environ.get(COMPILE) == "0":
        told["NUMBA_DISABLE_JIT"] = "1"
    os.environ.update(told)
    if told and "numba" in sys.modules:  # imported before, with settings of its own
        sys.modules["numba"].config.reload_config()
