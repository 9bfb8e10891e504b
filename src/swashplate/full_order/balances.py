"""Energy and flow balances of a full-order simulation.

What passed through a mechanism is integrated beside the states, each power by its own equation;
what is stored follows from the states alone. That both agree checks the equations as a whole.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.full_order.observe import stored_energies

if TYPE_CHECKING:
    from swashplate.full_order.result import FullOrderSimulation

Array = NDArray[np.float64]


class Balance(NamedTuple):
    """One balance over time."""

    residual: Array
    """What is missing at each sample. [J] or [m³]"""
    turnover: float
    """Largest of the amounts that meet in it. [J] or [m³]"""

    @property
    def worst(self) -> float:
        """Largest residual over the turnover. [1]"""
        if self.turnover == 0.0:
            return float(np.abs(self.residual).max())
        return float(np.abs(self.residual).max() / self.turnover)


class Balances(NamedTuple):
    """Balances of one simulation."""

    spool: Balance
    """Energy of spool, feedback arm and feedback spring: work of the solenoids and of the plate's
    arm = stored + lost in damping and at the stroke. [J]"""
    swash: Balance
    """Energy of plate, piston and return spring: work of the stroker pressure = stored + lost in
    damping and at the stops + work against the pumping pistons. [J]"""
    load: Balance
    """Energy sent to the motor = kinetic energy of the load + work against gravity. [J]"""
    oil: Balance
    """Oil at the stroking piston: through the valve = swept + compressed + leaked + relieved.
    [m³]"""

    @property
    def worst(self) -> float:
        """Worst of the four. [1]"""
        return max(each.worst for each in self)


def balances_of(run: FullOrderSimulation) -> Balances:
    """The four balances of a simulation, zero at its start."""
    m, rows = run.machine.p, np.ascontiguousarray(run.rows[:: run.record.substeps])
    lost = run.losses[:: run.record.substeps]
    stored = np.empty((rows.shape[0], 3))
    stored_energies(rows, m, stored)
    stored = stored - stored[0]
    angle, pressure = rows[:, 3], rows[:, 2]
    turned = m.motor_constant * m.pump_flow_gain * _ideal_angle(run)
    swept = m.piston_area * m.swash_arm * (np.tan(angle) - np.tan(angle[0]))
    squeezed = m.oil_volume / m.bulk_modulus * (pressure - pressure[0])
    account = run.account
    return Balances(
        _balance(
            (account("solenoid_work"), account("feedback_work")),
            (stored[:, 0], account("spool_damping_loss"), lost[:, 0]),
        ),
        _balance(
            (account("piston_work"),),
            (
                stored[:, 1],
                account("piston_damping_loss"),
                account("pumping_work"),
                lost[:, 1],
            ),
        ),
        _balance((account("motor_work"),), (stored[:, 2], m.load_torque * turned)),
        _balance(
            (account("valve_volume"),),
            (swept, squeezed, account("leakage_volume"), account("relief_volume")),
        ),
    )


def _ideal_angle(run: FullOrderSimulation) -> Array:
    """Integral of the swash angle, from the shaft's position and what leaked. [rad s]"""
    m = run.machine.p
    gain = m.motor_constant * m.pump_flow_gain
    angle = run.swash_angle - run.swash_angle[0]
    time = run.time - run.time[0]
    leaked = m.motor_leakage * (m.load_inertia * gain * angle + m.load_torque * time)
    return np.asarray((run.shaft_position + leaked) / gain)


def _balance(came: tuple[Array, ...], went: tuple[Array, ...]) -> Balance:
    residual = sum(came, np.zeros_like(came[0])) - sum(went, np.zeros_like(came[0]))
    return Balance(residual, max(float(np.abs(each).max()) for each in (*came, *went)))
