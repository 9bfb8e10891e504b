"""The trusted path: SciPy's stiff solvers on the compiled rates, restarted at every event."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError
from swashplate.full_order.march import (
    ACCOUNTS,
    N_ROW,
    Flags,
    Holds,
    first_short,
    jacobian_at,
    margin_at,
    rates_at,
    settle_at,
)
from swashplate.full_order.stretches import Stretch, stretches_of

if TYPE_CHECKING:
    from swashplate.full_order.machine import Plate
    from swashplate.models.pump import Pump

Array = NDArray[np.float64]
StiffMethod = Literal["radau", "lsoda"]

LOOKS = 4
"""Points a sample at which a step is searched for an event."""
SHORT = -1e-12
"""Margin below which a limit has been reached or let go; a restart on a limit has none, but for
rounding. [1, rad]"""
GRAZING = -1e-7
"""The same after a limit has let go, until the state is clear of it: a step's interpolation is off
by more than rounding, and would find the limit that is being left again and again. [1, rad]"""
MOST_EVENTS = 10_000
STATE_TOLERANCES = (1e-9, 1e-7, 1.0, 1e-9, 1e-7)
"""Absolute: position [m], velocity [m/s], pressure [Pa], angle [rad], swash rate [rad/s]."""
ACCOUNT_TOLERANCES = {"work": 1e-7, "loss": 1e-7, "volume": 1e-12, "position": 1e-7}
"""Absolute: [J], [J], [m³], [rad]."""


class Plant(NamedTuple):
    """What is integrated: record and machine, in the order that the compiled functions take."""

    current: Array
    held: bool
    step: float
    holds: Holds
    machine: Plate
    pump: Pump


def solve(
    method: StiffMethod,
    current: Array,
    force: Array,
    held: bool,
    step: float,
    machine: Plate,
    pump: Pump,
    start: Array,
    tolerance: float,
) -> tuple[Array, Flags, Array, int]:
    """Integrate the five states and their accounts over a signed current.

    Parameters
    ----------
    method : {"radau", "lsoda"}
        SciPy's solver. Its BDF is left out: beyond second order it is unstable along the imaginary
        axis, where the plate on its trapped oil swings, and took 25 times as long as Radau.
    current, force, held, step :
        The record as in `swashplate.full_order.march.march`, and the net solenoid force at its
        samples. [N]
    start : (N_ROW,) array
        The first row.
    tolerance : float
        Relative tolerance; the absolute ones are `STATE_TOLERANCES` and `ACCOUNT_TOLERANCES`, in
        proportion to it, given for 1e-6.

    Returns
    -------
    rows, holds, losses, events
        As `march` leaves them.

    Raises
    ------
    DomainError
        If the solver gives up or a limit chatters, with the time.
    """
    time = step * np.arange(current.size, dtype=np.float64)
    rows = np.empty((time.size, N_ROW))
    holds_at, losses_at = np.zeros((time.size, 3), np.int8), np.zeros((time.size, 2))
    row, losses = start.copy(), np.zeros(2)
    plant = Plant(current, held, step, (0, 0, 0), machine, pump)
    plant = plant._replace(holds=settle_at(0.0, row, *plant, losses))
    rows[0], holds_at[0], losses_at[0] = row, plant.holds, losses
    now, done, events, least = 0.0, 1, 0, SHORT
    for stretch in stretches_of(force, held, step) if time.size > 1 else []:
        solver = _solver(method, plant, now, row, time[stretch.end], stretch, tolerance)
        while done <= stretch.end:
            before = now
            message = solver.step()
            if solver.status == "failed":
                raise DomainError(f"The {method} solver gives up at {now:.6g} s: {message}")
            now, row, between = solver.t, solver.y, solver.dense_output()
            looks = _looks(before, now, step)
            seen = np.vstack([between(looks[:-1]).T, row])
            short = first_short(looks, seen, least, *plant)
            if short >= 0:
                low = looks[short - 1] if short else before
                now = _first_beyond(low, looks[short], between, least, plant)
                row = np.array(between(now))
            while done < time.size and time[done] <= now:
                rows[done] = between(time[done]) if time[done] < now else row
                holds_at[done], losses_at[done] = plant.holds, losses
                done += 1
            if short < 0:
                if margin_at(now, row, *plant) > 0.0:
                    least = SHORT
                continue
            plant = plant._replace(holds=settle_at(now, row, *plant, losses))
            least = SHORT if margin_at(now, row, *plant) > 0.0 else GRAZING
            if time[done - 1] == now:
                rows[done - 1], holds_at[done - 1], losses_at[done - 1] = row, plant.holds, losses
            events += 1
            if events > MOST_EVENTS:
                raise DomainError(f"The limits of the machine chatter at {now:.6g} s.")
            if done <= stretch.end:
                solver = _solver(method, plant, now, row, time[stretch.end], stretch, tolerance)
    return rows, holds_at, losses_at, events


def _solver(
    method: StiffMethod,
    plant: Plant,
    begin: float,
    row: Array,
    end: float,
    stretch: Stretch,
    tolerance: float,
) -> Any:
    """SciPy's solver from here to the end of a stretch."""
    from scipy.integrate import LSODA, Radau

    accounts = [ACCOUNT_TOLERANCES[each.rpartition("_")[2]] for each in ACCOUNTS]
    return (Radau if method == "radau" else LSODA)(
        lambda time, state: rates_at(time, state, *plant),
        begin,
        row,
        end,
        jac=lambda time, state: jacobian_at(time, state, *plant),
        rtol=tolerance,
        atol=np.array([*STATE_TOLERANCES, *accounts]) * (tolerance / 1e-6),
        max_step=stretch.longest,
    )


def _looks(before: float, now: float, step: float) -> Array:
    """Times within a step at which it is searched for events, its end the last. [s]"""
    count = max(int(np.ceil((now - before) / step * LOOKS)), 1)
    looks = np.linspace(before, now, count + 1)[1:]
    looks[-1] = now
    return looks


def _first_beyond(low: float, high: float, between: Any, least: float, plant: Plant) -> float:
    """The time just beyond an event, by bisection down to neighbours. [s]"""
    while True:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            return high
        if margin_at(middle, np.array(between(middle)), *plant) < least:
            high = middle
        else:
            low = middle
