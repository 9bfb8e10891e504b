"""Tables of what a drive can do and what limits it, in the units of people."""

from __future__ import annotations

from math import degrees
from typing import TYPE_CHECKING

from swashplate.cli.terminal import table

if TYPE_CHECKING:
    from rich.table import Table

    from swashplate.analysis.envelope import Envelope, Way
    from swashplate.analysis.limits import LimitShares
    from swashplate.analysis.tracking import LargestSine


def envelope_table(found: Envelope) -> Table:
    """Dead zone, gains, limits and times of both ways."""
    made = table(None, "Envelope", ">positive", ">negative", "")

    def row(name: str, unit: str, *cells: str | None) -> None:
        made.add_row(name, *("none" if cell is None else cell for cell in cells), unit)

    def angular(name: str, unit: str, key: str, decimals: int) -> None:
        values = (getattr(way, key) for way in (found.plus, found.minus))
        row(name, unit, *(None if v is None else f"{degrees(v):z.{decimals}f}" for v in values))

    ways = (found.plus, found.minus)
    row("dead zone up to", "V", *(f"{way.dead_zone:z.3f}" for way in ways))
    angular("smallest speed", "deg/s", "smallest_speed", 3)
    angular("gain, mean", "(deg/s)/V", "gain", 3)
    row("gain, range", "(deg/s)/V", *(_range(way) for way in ways))
    saturation = (way.saturation_voltage for way in ways)
    row("saturation voltage", "V", *(None if v is None else f"{v:.2f}" for v in saturation))
    angular("speed at full voltage", "deg/s", "top_speed", 3)
    angular("speed limit", "deg/s", "speed_limit", 3)
    angular("acceleration at rest", "deg/s²", "acceleration", 2)
    row("... set by the", "", *(way.accelerated_by for way in ways))
    for step in ("starting", "stopping"):
        times = [getattr(way, step) for way in ways]
        row(f"{step}, 10 to 90 %", "s", *(None if t is None else f"{t.rise:.3f}" for t in times))
        row(f"{step}, to 90 %", "s", *(None if t is None else f"{t.reach:.3f}" for t in times))
    made.add_section()
    made.add_row("creep at 0 V", f"{degrees(found.creep):z.3f}", "", "deg/s")
    return made


def _range(way: Way) -> str | None:
    if way.gain_range is None:
        return None
    return " to ".join(f"{degrees(each):.3f}" for each in way.gain_range)


def sine_table(sines: LargestSine) -> Table:
    """The largest sine at each frequency."""
    made = table(
        f"Largest sine followed within {100.0 * sines.error:g} %",
        ">frequency Hz",
        ">lag forgiven deg/s",
        ">lag counted deg/s",
    )
    for frequency, *amplitudes in zip(sines.frequencies, sines.shifted, sines.in_time, strict=True):
        cells = (f"{degrees(a):.2f}" if a > 0.0 else "none" for a in amplitudes)
        made.add_row(f"{frequency:g}", *cells)
    return made


def share_table(found: LimitShares) -> Table:
    """What each limit costs that does anything, the costliest first."""
    made = table(
        None,
        "Limit",
        ">share of time",
        ">error without it\ndeg/s",
        ">share of error",
        ">error if alone\ndeg/s",
    )
    for share in found.shares:
        if not (share.time_share or share.error_share or share.failure or share.alone):
            continue  # it does nothing here
        time = share.time_share
        made.add_row(
            share.limit,
            "" if time is None else f"{100.0 * time:.1f} %" if time else "never",
            "none" if share.error is None else f"{degrees(share.error):.3f}",
            "" if share.error_share is None else f"{100.0 * share.error_share:z.1f} %",
            "none" if share.alone is None else f"{degrees(share.alone):.3f}",
        )
    return made
