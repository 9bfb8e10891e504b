"""Residuals of an experiment, their Jacobian and its triangular factor, for one parameter set."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.simulation.blocks import (
    BLOCK,
    N_CHANNEL_ROWS,
    N_PRESSURE_ROWS,
    START_AT,
    Tangents,
)
from swashplate.simulation.build import Constants, build, build_pump
from swashplate.simulation.constants import N_CHANNEL_NUMBERS, Channel, Delay
from swashplate.simulation.fused import march_observed, room_for
from swashplate.simulation.gradients import rest_tangent
from swashplate.simulation.observation import ObservedRecord, Own
from swashplate.simulation.placing import Sink
from swashplate.simulation.run import check_domain, check_start_pressure, drive_start, pump_start
from swashplate.simulation.sensitivities import steady_pump_tangent, steady_tangent
from swashplate.simulation.tangent import N_ALL, N_CHANNEL, N_PUMP
from swashplate.simulation.triangle import ROWS, aligned, combine, upright
from swashplate.simulation.wanted import START_PRESSURE as START_PRESSURE
from swashplate.simulation.wanted import Wanted, wanted_columns, wanted_rows

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

NO_DELAY = Delay(0, 0.0, 0, 0.0, 0.0)
NO_CHANNEL = Channel._make([*(1.0,) * N_CHANNEL_NUMBERS, None, None])
"""Stand in for a card where a current is given."""
NOTHING_OWN = Own()


class Jacobian(NamedTuple):
    """Weighted residuals and their derivatives."""

    names: tuple[str, ...]
    """Columns: those asked for, then the observations' own unknowns."""
    rows: Array
    """(k + 1, m): the columns one after the other, each over all m samples, residuals last."""
    squares: Array
    """Sum of squared residuals of each observation."""

    @property
    def columns(self) -> Array:
        """(m, k) derivatives of the residuals, a view. [weighted signal/...]"""
        return np.asarray(self.rows[:-1].T)

    @property
    def residuals(self) -> Array:
        """(m,) weight · (simulated - measured), a view."""
        return np.asarray(self.rows[-1])


class Triangle(NamedTuple):
    """The same problem in k + 1 rows."""

    names: tuple[str, ...]
    """Columns, as in `Jacobian`."""
    factor: Array
    """(k + 1, k + 1) upper triangle R of [J r], with RᵀR = [J r]ᵀ[J r]; no diagonal element is
    negative."""
    squares: Array
    """Sum of squared residuals of each observation."""


def residuals(
    parameters: ParameterSet,
    observed: ObservedRecord,
    own: Own = NOTHING_OWN,
    *,
    block: int = BLOCK,
) -> Array:
    """Weighted residuals of all observations, one after the other.

    Parameters
    ----------
    parameters : ParameterSet
        The drive.
    observed : ObservedRecord
        The record, and what was measured under it.
    own : Own
        Values of the experiment's own unknowns.
    block : int
        Samples marched at a time, 2 to 512.

    Returns
    -------
    (m,) array
        weight · (simulated - measured) in the signals' SI units; 0 where the weight is.

    Raises
    ------
    DomainError
        If the solenoid overpowers the feedback spring, or the pressure at the start lies beyond
        its limits.
    InputError
        If the card's filter is unstable at this step, or the own unknowns do not fit.
    """
    nothing = wanted_rows((), False, False, False)
    sink = _all_rows(np.empty((1, observed.rows)), nothing, observed)
    _march(parameters, observed, own, nothing, sink, block)
    return np.asarray(sink.rows[0])


def jacobian(
    parameters: ParameterSet,
    observed: ObservedRecord,
    columns: Sequence[str],
    own: Own = NOTHING_OWN,
    *,
    out: Array | None = None,
    block: int = BLOCK,
) -> Jacobian:
    """The same residuals with their exact derivatives.

    Parameters
    ----------
    parameters, observed, own, block :
        As in `residuals`.
    columns : sequence of str
        Symbols (``"Z16"`` stands for both directions), columns (``"Z16_plus"``) and
        ``"start_pressure"``. What the record does not depend on gives zeros.
    out : (k + 1, m) array, optional
        Where to write; the `rows` of an earlier call, for example. New memory takes longer to get
        than the whole march.
    """
    wanted = wanted_columns(parameters, observed, tuple(columns))
    k = len(wanted.names) + len(observed.own_columns)
    shape = (k + 1, observed.rows)
    if out is None:
        out = np.empty(shape)
    elif out.shape != shape or out.dtype != np.float64 or not out.flags.carray:
        raise InputError(f"out must be a plain array of floats of shape {shape}.")
    idle = np.setdiff1d(np.arange(len(wanted.names)), wanted.to)
    out[idle] = 0.0
    sink = _all_rows(out, wanted, observed)
    _march(parameters, observed, own, wanted, sink, block)
    return Jacobian(wanted.names + observed.own_columns, out, sink.squares)


def triangle(
    parameters: ParameterSet,
    observed: ObservedRecord,
    columns: Sequence[str],
    own: Own = NOTHING_OWN,
    *,
    block: int = BLOCK,
) -> Triangle:
    """Triangular factor of [J r]; arguments as in `jacobian`, which is never held.

    Memory does not grow with the record, apart from the record and the observations themselves.
    """
    wanted = wanted_columns(parameters, observed, tuple(columns))
    derived, own_count = wanted.to.size, len(observed.own_columns)
    size = derived + own_count + 1
    sink = Sink(
        rows=aligned(size, ROWS),
        to=np.arange(derived),
        own=derived + np.arange(own_count),
        factor=np.zeros((size, size)),
        squares=np.zeros(len(observed.observations)),
    )
    _march(parameters, observed, own, wanted, sink, block)
    names = wanted.names + observed.own_columns
    places = np.concatenate([wanted.to, np.arange(len(wanted.names), len(names) + 1)])
    if (np.diff(places) > 0).all():
        factor = np.zeros((len(names) + 1, len(names) + 1))
        factor[np.ix_(places, places)] = sink.factor
        factor = upright(factor)
    else:
        spread = np.zeros((size, len(names) + 1))
        spread[:, places] = sink.factor
        factor = combine([spread])
    return Triangle(names, factor, sink.squares)


def _all_rows(rows: Array, wanted: Wanted, observed: ObservedRecord) -> Sink:
    """A sink that keeps all rows."""
    return Sink(
        rows=rows,
        to=wanted.to,
        own=np.arange(len(wanted.names), rows.shape[0] - 1),
        factor=np.zeros((0, 0)),
        squares=np.zeros(len(observed.observations)),
    )


def _march(
    parameters: ParameterSet,
    observed: ObservedRecord,
    own: Own,
    wanted: Wanted,
    sink: Sink,
    block: int,
) -> None:
    """March, and fill the sink."""
    if not 2 <= block <= BLOCK:
        raise InputError(f"block is {block}, but must be 2 to {BLOCK} samples.")
    record, by_voltage = observed.record, observed.driven_by == "voltage"
    if by_voltage:
        constants = build(parameters, record.step)
        _, plus, minus, pump, step = constants
        before, state = drive_start(record.values, plus, minus, pump, observed.start)
    else:
        pump, step = build_pump(parameters), record.step
        constants = Constants(NO_DELAY, NO_CHANNEL, NO_CHANNEL, pump, step)
        before = 0.0
        state = (0.0, 0.0, pump_start(record.values, pump, observed.start))
    tangents = _start_tangents(constants, observed, before, state, own.start_pressure)
    if own.start_pressure is not None:
        state = (*state[:2], check_start_pressure(parameters.name, own.start_pressure, pump))
    elif START_PRESSURE in wanted.names:
        raise InputError(f"{START_PRESSURE} is a column, so Own needs a value of it.")
    plan = observed.plan(own, len(wanted.names) if sink.factor.size == 0 else wanted.to.size)
    worst = march_observed(
        # the kernels are compiled for arrays that can be written to
        np.require(record.values, np.float64, ["C", "W"]),
        by_voltage,
        before,
        *constants,
        block,
        state,
        tangents,
        wanted.columns,
        plan,
        sink,
        room_for(wanted.to.size, *plan.kept.shape),
    )
    check_domain(parameters.name, worst, observed.driven_by)


def _start_tangents(
    constants: Constants,
    observed: ObservedRecord,
    before: float,
    state: tuple[float, float, float],
    start_pressure: float | None,
) -> Tangents:
    """Derivatives of the states at the first sample."""
    plus, minus = np.zeros(N_CHANNEL + 1), np.zeros(N_CHANNEL + 1)
    pump, step = constants.pump, constants.step
    d_pressure = rest_tangent(pump, N_ALL)
    if observed.start == "steady" and observed.driven_by == "voltage":
        _, of_plus, of_minus, _, _ = constants
        steady_tangent(before, of_plus, of_minus, pump, step, state, plus, minus, d_pressure)
    elif observed.start == "steady":
        current = float(observed.record.values[0])
        steady_pump_tangent(current, pump, step, state[2], d_pressure[:N_PUMP])
    pressure = np.zeros(N_PRESSURE_ROWS)
    if start_pressure is None:
        pressure[:N_ALL] = d_pressure
    else:
        pressure[START_AT] = 1.0
    channels = np.zeros((2, 3, N_CHANNEL_ROWS))
    channels[0, :, : plus.size], channels[1, :, : minus.size] = plus, minus
    return Tangents(pressure, channels[0], channels[1])
