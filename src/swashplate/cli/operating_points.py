"""Where a machine of a user's own is linearised, and what its linear model says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, pi
from typing import TYPE_CHECKING

from swashplate.cli.machines import OwnMachine, without_empty
from swashplate.errors import DomainError, InputError
from swashplate.tables import Cell, Column, Table, count
from swashplate.units import unit_text

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from swashplate.machine.linear import LinearModel, SettledPoint

    Array = NDArray[np.float64]
AT_ZERO = 1e-9
"""Size of a sampled pole, or distance of it from 1, that counts as 0. [1]"""
ROUNDED = 1e-8
"""Part of the largest answer to an input below which another one is rounding. [1]"""
GONE, INTEGRATES = 1e-3, 1e-6
"""The same of poles of several, which differ by roots of rounding: three at 0 by 1e-5. [1]"""


def operating_point(own: OwnMachine, at: Mapping[str, float], rate: float) -> SettledPoint:
    """States that a machine settles at under constant inputs, in steps of a rate [Hz].

    Those that the command line sets, if it sets any.
    """
    import numpy as np

    from swashplate.machine.linear import SettledPoint, settle, states_at_start

    if own.stated:
        states = states_at_start(own.machine, at, rate, own.begin)
        return SettledPoint(own.machine, states, np.zeros(states.size))
    return settle(own.machine, at, rate, begin=own.begin)


def rates_under(own: OwnMachine, at: Mapping[str, float], rate: float) -> dict[str, float]:
    """Rates of the states that go on under constant inputs, by signal; none if nothing settles."""
    try:
        rates = operating_point(own, at, rate).rates.tolist()
    except DomainError:
        return {}
    return dict(zip(_signals_of_states(own), rates, strict=True))


def _signals_of_states(own: OwnMachine) -> list[str]:
    """Signal of each state, in the order of `state_paths`."""
    return [own.model.parts[index].full(path) for index, path in own.model.places("state")]


def linear_model(
    own: OwnMachine,
    at: Mapping[str, float],
    rate: float,
    point: SettledPoint,
    *,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> LinearModel:
    """A machine's step, linearised at an operating point."""
    from swashplate.machine.linear import linearize

    states = None if point.by_equation else point.states
    return linearize(own.machine, at, rate, states=states, inputs=inputs, outputs=outputs)


def outputs_named(own: OwnMachine, names: Sequence[str] | None) -> list[str] | None:
    """Full names of outputs; None if none is named."""
    known = [*own.model.every_signal, *own.model.integrals]
    return [own.named(name, known, "signal") for name in names] if names else None


# --- tables ---------------------------------------------------------------------------------------


def linear_tables(
    own: OwnMachine,
    at: Mapping[str, float],
    point: SettledPoint,
    model: LinearModel,
    frequency: float,
) -> list[Table]:
    """Operating point, gains at 0 Hz and at a frequency [Hz], and poles."""
    return [_point_table(own, at, point), _gains_table(own, model, frequency), poles_table(model)]


def _point_table(own: OwnMachine, at: Mapping[str, float], point: SettledPoint) -> Table:
    from swashplate.machine.model import state_paths

    columns = (Column("Operating point"), Column("is"), Column("", ".5g"), Column("unit"))
    table = Table("", (*columns, Column("changes", "s")))
    for name, value in at.items():
        table.add(name, "input", value, unit_text(own.unit(name)), "")
    signals = _signals_of_states(own)
    rows = zip(state_paths(own.model), signals, point.flat, point.rates, strict=True)
    for path, signal, value, rate in rows:
        unit = unit_text(own.unit(signal))
        goes_on = f"by {rate:.5g} {unit}/s".replace(" /s", " 1/s") if rate else ""
        table.add(path, "state", float(value), unit, goes_on)
    return without_empty(table)


def _gains_table(own: OwnMachine, model: LinearModel, frequency: float) -> Table:
    at = f"at {frequency:g} Hz"
    columns = (
        Column("from"),
        Column("to"),
        Column("steady gain", ".5g", none="integrates"),
        *_answer_columns(at),
    )
    table = Table("", columns)
    for name in model.inputs:
        steady = model.response([0.0], name)[:, 0].real
        answers = _answers(own, model, name, frequency)
        for output, gain, answer in zip(model.outputs, steady, answers, strict=True):
            table.add(name, output, float(gain) if abs(gain) < inf else None, *answer)
    return without_empty(table)


def answers_table(own: OwnMachine, model: LinearModel, frequency: float) -> Table:
    """Gain and phase of each output that answers each input at a frequency [Hz].

    The steady gain of a machine with several states that integrate cannot be computed.
    """
    table = Table("", (Column("from"), Column("to"), *_answer_columns(f"at {frequency:g} Hz")))
    for name in model.inputs:
        answers = _answers(own, model, name, frequency)
        least = ROUNDED * max(gain for gain, _, _ in answers)
        for output, answer in zip(model.outputs, answers, strict=True):
            if answer[0] > least:
                table.add(name, output, *answer)
    return without_empty(table)


def _answer_columns(at: str) -> tuple[Column, ...]:
    return (Column(f"gain {at}", ".5g"), Column("unit"), Column(f"phase {at}", ".2f", "rad"))


def _answers(
    own: OwnMachine, model: LinearModel, name: str, frequency: float
) -> list[tuple[float, str, float | None]]:
    """Gain, unit and phase [rad] of each output for an input at a frequency [Hz]."""
    import numpy as np

    if model.rate is not None and not 0.0 <= frequency <= 0.5 * model.rate:
        raise InputError(
            f"--frequency is {frequency:g} Hz, but must be from 0 to half the rate, "
            f"{0.5 * model.rate:g} Hz."
        )
    answers = model.response([frequency], name)[:, 0]
    return [
        (
            float(abs(answer)),
            _gain_unit(own.unit(output), own.unit(name)),
            float(np.angle(answer)) if abs(answer) > 0.0 else None,
        )
        for output, answer in zip(model.outputs, answers, strict=True)
    ]


def _gain_unit(output: str, input: str) -> str:
    """Unit of an output by an input."""
    below = f"({input})" if "/" in input or " " in input else input
    if not input or input == "1":
        return unit_text(output)
    if output == input:
        return ""
    above = f"({output})" if "/" in output else output
    return f"{unit_text(above) or '1'}/{unit_text(below)}"


def poles_table(model: LinearModel) -> Table:
    """Poles in the s-plane, of two conjugate ones the upper; those of delays are left out."""
    import numpy as np

    columns = (
        Column("Poles"),
        Column("real", ".5g"),
        Column("imaginary", "s"),
        Column("Hz", ".4g"),
        Column("damping", ".3f"),
    )
    table = Table("", columns)
    sampled = model.rate is not None
    ended = np.abs(model.poles) < AT_ZERO if sampled else np.zeros(model.poles.size, dtype=bool)
    for pole in model.poles[~ended & (model.poles.imag >= 0.0)]:
        s = pole if model.rate is None else np.log(pole) * model.rate
        size = float(abs(s))
        if size == 0.0 or (sampled and abs(pole - 1.0) < AT_ZERO):
            table.add("rad/s", 0.0, "", 0.0, Cell(None, "integrates"))
            continue
        real = float(s.real) if abs(s.real) > AT_ZERO * size else 0.0
        imaginary = f"±{s.imag:.5g}" if s.imag else ""
        table.add("rad/s", real, imaginary, size / (2.0 * pi), (0.0 - real) / size)
    if ended.any():
        table.caption = f"{count(int(ended.sum()), 'pole')} more at z = 0: gone after one step"
    return table


def modes_table(model: LinearModel, members: Sequence[str]) -> Table:
    """Modes of the members of a joined machine, of two conjugate poles the upper one.

    Of members that act on each other they are common; of the others each has its own.
    """
    import numpy as np

    columns = (
        Column("Mode of"),
        Column("real", ".5g"),
        Column("imaginary", "s"),
        Column("unit"),
        Column("Hz", ".4g"),
        Column("damping", ".4f"),
    )
    table = Table("", columns)
    others = 0
    for group in model.groups_of(members):
        beginnings = tuple(f"{member}." for member in group)
        poles = model.poles_of(*[name for name in model.states if name.startswith(beginnings)])
        moving = (np.abs(poles) >= GONE) & (np.abs(poles - 1.0) >= INTEGRATES)
        others += int((~moving).sum())
        for pole in poles[moving & (poles.imag >= 0.0)]:
            s = np.log(pole) * (model.rate or 1.0)
            size = float(abs(s))
            imaginary = f"±{s.imag:.5g}" if s.imag else ""
            frequency = size / (2.0 * pi)
            table.add(
                ", ".join(group),
                float(s.real),
                imaginary,
                "rad/s",
                frequency,
                -float(s.real) / size,
            )
    table.caption = f"{count(others, 'pole')} more: gone within a few steps, or integrate"
    return table
