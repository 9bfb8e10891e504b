"""What environment variables say of compiling: where code is kept, for which processor, whether."""

from __future__ import annotations

import os

CACHE_DIR, CPU, COMPILE = "SWASHPLATE_CACHE_DIR", "SWASHPLATE_CPU", "SWASHPLATE_COMPILE"
"""Folder of compiled code; LLVM's name of the processor that is compiled for; 0: nothing is."""


def told_folder() -> str:
    """Folder for all that is kept, if one is said; else empty."""
    return os.environ.get(CACHE_DIR, "")


def told_processor() -> str:
    """Processor that is compiled for, if one is said; else empty: this one."""
    return os.environ.get(CPU, "")


def compiles() -> bool:
    """Whether anything is compiled."""
    return os.environ.get(COMPILE, "") != "0"
