"""Physical values, modes and differences of the full-order model, in the units of people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import pi
from typing import TYPE_CHECKING

from swashplate.cli.inputs import numbers_and_unit
from swashplate.cli.terminal import table
from swashplate.errors import InputError

if TYPE_CHECKING:
    import polars
    from rich.table import Table

    from swashplate.full_order import Comparison, FullOrderDrive
    from swashplate.parameters.parameter_set import Change

UNITS = {
    "kg": ("g", 1e3),
    "m": ("mm", 1e3),
    "m^2": ("cm²", 1e4),
    "m^3": ("cm³", 1e6),
    "Pa": ("MPa", 1e-6),
    "rad/s": ("Hz", 0.5 / pi),
    "kg m^2": ("kg m²", 1.0),
    "1/m^3": ("1/m³", 1.0),
    "1": ("", 1.0),
}
"""Unit that people read and the factor to it, by SI unit; another stays as it is."""
LAG_SHARE = 0.5
"""Share of the difference from which a lag explains it."""


def physical_values(words: Sequence[str]) -> dict[str, Change]:
    """Physical values in SI from words such as ``oil_volume=100cm^3``."""
    values: dict[str, Change] = {}
    for word in words:
        name, change = _physical_value(word)
        if name in values:
            raise InputError(f"--physical gives {name} twice; give it once.")
        values[name] = change
    return values


def _physical_value(word: str) -> tuple[str, Change]:
    from swashplate.full_order.physical_set import chosen_quantity, si_value

    name, _, given = (part.strip() for part in word.partition("="))
    read = numbers_and_unit(given)
    if read is None:
        raise InputError(
            f"--physical cannot read '{word}'; write it as oil_volume=1e-4 or oil_volume=100cm^3."
        )
    quantity = chosen_quantity(name)
    numbers, unit = read
    if unit:
        numbers = [si_value(quantity, number, unit) for number in numbers]
    return name, numbers[0] if len(numbers) == 1 else (numbers[0], numbers[1])


def chosen_table(axis: str, given: Mapping[str, Change]) -> Table:
    """What the physical set was completed from: assumed values and given ones."""
    from swashplate.full_order.physical_set import chosen_over, load_choices

    made = table("What the drive's parameters do not say", "Physical value", ">", "", "")
    for name, entry in chosen_over(load_choices(axis), given).items():
        unit, factor = UNITS.get(entry.unit, (entry.unit, 1.0))
        numbers = "/".join(f"{factor * value:.5g}" for value in entry.values)
        made.add_row(name, numbers, unit, "given" if entry.status == "user" else "assumed")
    return made


def assumed_said(axis: str, given: Mapping[str, Change]) -> str:
    """How much of the physical set is assumed."""
    from swashplate.full_order.physical_set import chosen_over, load_choices

    entries = chosen_over(load_choices(axis), given)
    assumed = sum(entry.status != "user" for entry in entries.values())
    if not assumed:
        return "All physical values are given."
    return (
        f"{assumed} of {len(entries)} physical values are assumed, as of the packaged {axis}; "
        "--physical gives what you know."
    )


def modes_table(full: FullOrderDrive) -> Table:
    """Natural modes at rest."""
    modes = full.modes()
    made = table("Modes at rest", "Mode", ">Hz", ">damping", "")
    slow = f"τ = {-1.0 / modes.slow.real:.4g} s, " if modes.slow.real < 0.0 else ""
    for name, mode, words in (
        ("spool", modes.spool, "on its feedback spring"),
        ("swash plate", modes.swash, "on its spring and the trapped oil"),
        ("swash plate, held pressure", modes.swash_at_held_pressure, "on its spring alone"),
        ("slow pole", modes.slow, f"{slow}which one state keeps"),
    ):
        hertz, ratio = modes.frequency_hz(mode), modes.damping_ratio(mode)
        made.add_row(name, f"{hertz:.4g}", f"{ratio:.3f}", words)
    return made


def run_table(found: Comparison) -> Table:
    """Both models under one command."""
    from swashplate.cli.measures import degrees
    from swashplate.full_order.comparison import BANDS

    differ = found.difference
    made = table("Reduced model less full-order one", "Shaft speed", ">deg/s", ">% of top speed")

    def row(name: str, value: float) -> None:
        share = f"{100.0 * value / differ.top_speed:.3f}" if differ.moves else ""
        made.add_row(name, f"{degrees(value):.4f}", share)

    made.add_row("top speed", f"{degrees(differ.top_speed):.2f}", "")
    row("largest difference", differ.largest)
    row("rms difference", differ.rms)
    row(f"step error of the march at {usual_rate(found.full.record.rate):g} Hz", differ.step_error)
    if differ.moves:
        for band in reversed(BANDS):
            made.add_row(f"within {100.0 * band:g} %", "", _yes(differ.relative <= band))
    made.add_section()
    drop = 1e-6 * found.full.motor_pressure_drop
    made.add_row("motor pressure drop, MPa", f"{drop.min():z.3f}", f"to {drop.max():z.3f}")
    return made


def usual_rate(rate: float) -> float:
    """Steps a second of the reduced model's march at a rate of samples. [Hz]"""
    from swashplate.equations.marching.record import least_substeps

    return rate * least_substeps(rate)


def run_verdict(found: Comparison) -> list[str]:
    """Whether one state is enough under a command, and what it leaves out."""
    differ = found.difference
    if not differ.moves:
        return ["The shaft does not move under this command, so nothing can be said of one state."]
    largest, rms = (
        f"{100.0 * each / differ.top_speed:.2f} %" for each in (differ.largest, differ.rms)
    )
    if differ.within is not None:
        said = [
            f"One state is enough here: within {100.0 * differ.within:g} % of the top speed, at "
            f"most {largest} and {rms} rms off."
        ]
    else:
        said = [
            f"One state is not enough here: up to {largest} of the top speed off, {rms} rms, where "
            "1 % is allowed."
        ]
    lag = found.lag
    left_out = "the masses of spool and swash plate"
    if lag is not None and lag.share >= LAG_SHARE:
        left_out += (
            f", which make the speed {1e3 * abs(lag.time):.2g} ms "
            f"{'later' if lag.time > 0.0 else 'earlier'} ({100.0 * lag.share:.0f} % of the mean "
            "squared difference)"
        )
    said.append(f"It leaves out {left_out}, and the motor's pressure drop.")
    return said


def validity_rows(found: polars.DataFrame, rate: float) -> Table:
    """The table of manoeuvres."""
    made = table(
        "Reduced model less full-order one, in % of the top speed",
        "Manoeuvre",
        ">top deg/s",
        ">largest",
        ">rms",
        f">step error at {usual_rate(rate):g} Hz",
        "within",
    )
    from swashplate.cli.measures import degrees

    for row in found.iter_rows(named=True):
        top = f"{degrees(row['top_speed']):.2f}"
        if row["largest_percent"] is None:
            made.add_row(row["maneuver"], top, "", "", "", "does not move")
            continue
        within = "0.1 %" if row["within_0_1_percent"] else "1 %" * row["within_1_percent"]
        shares = (row[f"{key}_percent"] for key in ("largest", "rms", "step_error"))
        made.add_row(row["maneuver"], top, *(f"{each:.2f}" for each in shares), within or "no")
    return made


def validity_verdict(found: polars.DataFrame) -> str:
    """For how many of the manoeuvres one state is enough, and for which it is not."""
    moving = found.drop_nulls("within_1_percent")
    beyond = moving.filter(~moving["within_1_percent"])["maneuver"].to_list()
    if not moving.height:
        return "The shaft does not move under any of these, so nothing can be said of one state."
    if not beyond:
        return "One state is enough for all of these that move the drive, to 1 % of the top speed."
    if len(beyond) == moving.height:
        return "One state is enough for none of these, to 1 % of the top speed."
    within = moving.height - len(beyond)
    return (
        f"One state is enough for {within} of {moving.height}, to 1 % of the top speed; not for "
        f"{', '.join(beyond)}."
    )


def _yes(answer: bool) -> str:
    return "yes" if answer else "no"
