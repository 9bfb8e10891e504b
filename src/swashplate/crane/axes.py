"""The three axes of a crane, the rate of its loop, and how an unknown name is refused."""

from __future__ import annotations

from collections.abc import Iterable

from swashplate.errors import InputError

AXES = ("hoist", "slew", "luff")
RATE = 512.0
"""Samples a second of the loop: that of the packaged drives. [Hz]"""


def check_names(
    beginning: str, names: Iterable[str], allowed: Iterable[str], has: str = "there are"
) -> None:
    """Refuse names that are not allowed, in a sentence that starts with `beginning`."""
    unknown = [name for name in names if name not in allowed]
    if unknown:
        raise InputError(f"{beginning} '{unknown[0]}'; {has} {', '.join(allowed)}.")
