"""From the words of a command line to levers, ranges and trials."""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan, nan
from typing import TYPE_CHECKING

import typer

from swashplate.cli.inputs import Options, simulated
from swashplate.cli.terminal import show, table
from swashplate.errors import InputError

if TYPE_CHECKING:
    from swashplate.analysis.outcomes import Trial
    from swashplate.analysis.sensitivity import Range
    from swashplate.drive import Drive


def list_levers(asked: bool) -> None:
    """Print the levers and end, if that is asked for."""
    if asked:
        from swashplate.analysis.whatif import LEVERS

        made = table(None, "lever", "multiplies", "what it is", wrap="what it is")
        for lever in LEVERS.values():
            if lever.meaning.startswith("The same"):
                continue
            by = ", ".join(
                symbol if power == 1.0 else f"{symbol} by its square"
                for symbol, power in lever.powers.items()
            )
            ways = " _plus _minus" if f"{lever.name}_plus" in LEVERS else ""
            made.add_row(f"{lever.name}{ways}", by, lever.meaning)
        show(made)
        raise typer.Exit


def factors_of(words: Sequence[str]) -> dict[str, float]:
    """Factors by lever from words such as ``orifice=1.5``."""
    from swashplate.analysis.whatif import find_lever

    factors: dict[str, float] = {}
    for word in words:
        name, _, given = (part.strip() for part in word.partition("="))
        try:
            factor = float(given)
        except ValueError:
            raise InputError(f"--scale cannot read '{word}'; write it as orifice=1.5.") from None
        find_lever(name)
        if name in factors:
            raise InputError(f"--scale gives {name} twice; give it once.")
        factors[name] = factor
    return factors


def trial_of(drive: Drive, command: str, options: Options) -> tuple[str, Trial]:
    """Name of a command, a manoeuvre or a log, and the trial that it makes."""
    from swashplate.analysis.outcomes import trial

    name, run = simulated(drive, command, options)
    assert run.voltage is not None  # the command line simulates voltages only
    return name, trial(drive, run.voltage, options.rate)


def ranges_from(words: Sequence[str], usual: Range) -> dict[str, Range]:
    """Ranges of factors by lever from words such as ``pump`` or ``pump=0.8/1.5``."""
    from swashplate.analysis.whatif import find_lever

    ranges: dict[str, Range] = {}
    for word in words:
        name, equals, given = (part.strip() for part in word.partition("="))
        find_lever(name)
        if name in ranges:
            raise InputError(f"--lever gives {name} twice; give it once.")
        if not equals:
            ranges[name] = usual
            continue
        low, slash, high = given.partition("/")
        try:
            ranges[name] = float(low), float(high) if slash else nan
        except ValueError:
            ranges[name] = nan, nan
        if any(map(isnan, ranges[name])):
            raise InputError(f"--lever cannot read '{word}'; write it as pump or pump=0.8/1.5.")
    return ranges
