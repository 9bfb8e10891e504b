"""Simulation with sensitivities: outputs and their exact derivatives by chosen parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.equations.marching.observation import Observation, ObservedRecord
from swashplate.equations.marching.record import Record
from swashplate.equations.marching.run import Start
from swashplate.errors import InputError
from swashplate.parameters.definitions import columns_of
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.simulation.instance import PATHS
from swashplate.simulation.residuals import jacobian
from swashplate.simulation.result import Simulation
from swashplate.simulation.run import simulate_drive, simulate_pump

Array = NDArray[np.float64]

OUTPUTS = ("current", "current_positive", "current_negative", "shaft_speed", "shaft_position")
"""Signals that have sensitivities."""
PUMP_COLUMNS = tuple(name for name, path in PATHS.items() if path.startswith("pump.Z"))
"""Columns of the pump and motor of the source."""
ALL_COLUMNS = (
    *PUMP_COLUMNS,
    *(name for name in PATHS if name.endswith("_plus") and name not in PUMP_COLUMNS),
    *(name for name in PATHS if name.endswith("_minus") and name not in PUMP_COLUMNS),
    "tau",
)
"""Columns of card, pump and motor, refinements apart, in their order."""


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Derivatives of the outputs by parameters, one column for each of `names`.

    The unit of a column is the output's over the parameter's, both SI. At a switch (the edge of a
    dead zone, a limit just reached) they are the one-sided derivatives that the equations declare.
    """

    simulation: Simulation
    """The plain simulation, the same to the last bit as without sensitivities."""
    names: tuple[str, ...]
    """Columns such as ``Z16_plus``, in the order asked for."""
    parameters: ParameterSet = field(repr=False)
    start: Start = "rest"
    _found: dict[str, Array] = field(default_factory=dict, repr=False)

    def __repr__(self) -> str:
        return f"Sensitivities({self.simulation!r}, by {', '.join(self.names)})"

    def _columns(self, signal: str) -> Array:
        """The Jacobian of unit weights: every sample observed as zero."""
        if signal not in self._found:
            run = self.simulation
            zeros = np.zeros(run.time.size)
            observed = ObservedRecord(
                run.record,
                [Observation(signal, run.time, zeros)],
                run.driven_by,
                self.start,
                others=run.measured,
            )
            self._found[signal] = jacobian(self.parameters, observed, self.names).columns
        return self._found[signal]

    @property
    def current_positive(self) -> Array:
        """(n, k) derivatives of the positive channel's current. [A/...]"""
        return self._columns("current_positive")

    @property
    def current_negative(self) -> Array:
        """(n, k) derivatives of the negative channel's current, a magnitude. [A/...]"""
        return self._columns("current_negative")

    @property
    def current(self) -> Array:
        """(n, k) derivatives of the signed current. [A/...]"""
        return self.current_positive - self.current_negative

    @property
    def shaft_speed(self) -> Array:
        """(n, k) derivatives of the speed. [(rad/s)/...]"""
        return self._columns("shaft_speed")

    @property
    def shaft_position(self) -> Array:
        """(n, k) derivatives of the position. [rad/...]"""
        return self._columns("shaft_position")

    def at(self, time: ArrayLike, output: str) -> Array:
        """(m, k) derivatives of an output at other time stamps, by linear interpolation.

        Parameters
        ----------
        time : (m,) array_like
            Time stamps. [s]
        output : str
            One of `OUTPUTS`.
        """
        rows = getattr(self, output)
        stamps = np.asarray(time, dtype=np.float64)
        return np.column_stack(
            [np.interp(stamps, self.simulation.time, column) for column in rows.T]
        )


def drive_sensitivities(
    parameters: ParameterSet, record: Record, start: Start, names: Sequence[str] | None
) -> Sensitivities:
    """Card and pump with derivatives; see `Drive.sensitivities`."""
    chosen = _chosen(names, ALL_COLUMNS)
    run = simulate_drive(parameters, record, start)
    return Sensitivities(run, chosen, parameters, start)


def pump_sensitivities(
    parameters: ParameterSet, record: Record, start: Start, names: Sequence[str] | None
) -> Sensitivities:
    """Pump alone with derivatives; see `Drive.sensitivities_current`."""
    chosen = _chosen(names, PUMP_COLUMNS)
    foreign = [name for name in chosen if PATHS[name].startswith("card.")]
    if foreign:
        raise InputError(
            f"{foreign[0]} belongs to the card, which a given current does not go through."
        )
    return Sensitivities(simulate_pump(parameters, record, start), chosen, parameters, start)


def _chosen(names: Sequence[str] | None, everything: tuple[str, ...]) -> tuple[str, ...]:
    if names is None:
        return everything
    if isinstance(names, str) or not names:
        raise InputError("Name at least one parameter to differentiate by, in a list.")
    return tuple(columns_of(list(names)))
