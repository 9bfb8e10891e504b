"""Advice on the next test, as tables for the terminal and for a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

from swashplate.cli.terminal import table

if TYPE_CHECKING:
    from rich.table import Table

    from swashplate.identification.experiment_design import Advice, Gain, Sensor, SensorAdvice

NAMED = 4
"""Unknowns that a row names."""
FIRST = "first to determine"
WORTH = 1e-3
"""Relative gain below which none is shown."""


def tests_table(title: str, judged: Sequence[Advice]) -> Table:
    """Tests, one a row, in the order given."""
    made = table(title, "test", ">s", *_columns(judged), wrap=_wide(judged))
    for each in judged:
        duration = "" if each.duration is None else f"{each.duration:g}"
        made.add_row(each.candidate, duration, *_cells(each, judged))
    return made


def sensors_table(title: str, sensors: Sequence[SensorAdvice]) -> Table:
    """Sensors to add, the best first."""
    judged = [each.advice for each in sensors]
    made = table(title, "sensor", "test", *_columns(judged), wrap=_wide(judged))
    for each in sorted(sensors, key=lambda found: found.advice.rank):
        made.add_row(each.sensor.kind, each.maneuver, *_cells(each.advice, judged))
    return made


def _any_new(judged: Sequence[Advice]) -> bool:
    return any(each.newly_determined for each in judged)


def _wide(judged: Sequence[Advice]) -> str:
    return FIRST if _any_new(judged) else "test"


def _columns(judged: Sequence[Advice]) -> tuple[str, ...]:
    return (*((FIRST,) if _any_new(judged) else ()), "gains most", ">better")


def _cells(advice: Advice, judged: Sequence[Advice]) -> tuple[str, ...]:
    named = ", ".join(advice.newly_determined[:NAMED])
    more = len(advice.newly_determined) - NAMED
    first = f"{named} + {more}" if more > 0 else named
    gained = "" if advice.best is None else _gained(advice.best)
    return (*((first,) if _any_new(judged) else ()), gained, _times(advice.d_gain))


def unknowns_table(gains: Sequence[Gain], best: Mapping[str, tuple[str, Gain]]) -> Table:
    """What is known of each unknown, and which test would tell most of it."""
    made = table(
        "For each unknown", "unknown", ">error now", ">then", "best test", wrap="best test"
    )
    for gain in gains:
        test, after = best.get(gain.name, ("none tells more", gain))
        made.add_row(gain.name, _percent(gain.before), _percent(after.after), test)
    return made


def _gained(gain: Gain) -> str:
    return f"{gain.name} {_percent(gain.before)} to {_percent(gain.after)}"


def _times(gain: float) -> str:
    return f"{gain:.2f}x" if gain > 1.0 + WORTH else ""


def _percent(error: float) -> str:
    return f"{100.0 * error:.2g} %" if error <= 1.0 else "-"


def described(sensor: Sensor) -> str:
    """A sensor in a line: its noise, and where that is known from."""
    from swashplate.campaign import KINDS

    unit = KINDS[sensor.kind].units[0]
    return (
        f"{sensor.kind}: noise {sensor.noise:.3g} {unit} ({sensor.origin}), one independent sample "
        f"every {sensor.memory:.3g} s"
    )


def write_advice(ranked: Sequence[Advice], sensors: Sequence[SensorAdvice], out: Path) -> None:
    """Write all that was judged, a row for each test, sensor and unknown, as CSV or Parquet."""
    import polars as pl

    from swashplate.tables import write_table

    judged = [("", each.candidate, each) for each in ranked]
    judged += [(each.sensor.kind, each.maneuver, each.advice) for each in sensors]
    rows = [
        {
            "test": test,
            "added sensor": kind,
            "duration": advice.duration,
            "unknown": gain.name,
            "relative error before": gain.before if isfinite(gain.before) else None,
            "relative error after": gain.after if isfinite(gain.after) else None,
            "first to determine": gain.name in advice.newly_determined,
            "D-gain": advice.d_gain,
        }
        for kind, test, advice in judged
        for gain in advice.gains
    ]
    write_table(pl.DataFrame(rows, infer_schema_length=None), out)
