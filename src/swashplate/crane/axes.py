"""The three axes of a crane, the rate of its loop, and how an unknown name is refused."""

from __future__ import annotations

from collections.abc import Iterable

from swashplate.errors import InputError

AXES = ("hoist", "slew", "luff")
RATE = 512.0
"""Samples a second of the loop: the packaged drives' own. [Hz]"""


def check_names(
    said: str, given: Iterable[str], known: Iterable[str], has: str = "there are"
) -> None:
    """Refuse names that are not known, in a sentence that begins as said."""
    strange = [each for each in given if each not in known]
    if strange:
        raise InputError(f"{said} '{strange[0]}'; {has} {', '.join(known)}.")
