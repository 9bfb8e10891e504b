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
from swashplate.simulation.run import Driver, simulate_drive

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


class Columns:
    """Derivatives of a signal by its name, computed when they are first asked for."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, found: Sensitivities | None, owner: type | None = None) -> Array:
        if found is None:
            return self  # type: ignore[return-value]  # the class's own attribute
        # the Jacobian of unit weights: every sample observed as zero
        run = found.simulation
        seen = Observation(self._name, run.time, np.zeros(run.time.size))
        observed = ObservedRecord(run.record, [seen], run.driven_by, found.start, run.measured)
        made = jacobian(found.parameters, observed, found.names).columns
        found.__dict__[self._name] = made
        return made


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

    def __repr__(self) -> str:
        return f"Sensitivities({self.simulation!r}, by {', '.join(self.names)})"

    current_positive = Columns()
    """(n, k) derivatives of the positive channel's current. [A/...]"""
    current_negative = Columns()
    """(n, k) derivatives of the negative channel's current, a magnitude. [A/...]"""
    shaft_speed = Columns()
    """(n, k) derivatives of the speed. [(rad/s)/...]"""
    shaft_position = Columns()
    """(n, k) derivatives of the position. [rad/...]"""

    @property
    def current(self) -> Array:
        """(n, k) derivatives of the signed current. [A/...]"""
        return self.current_positive - self.current_negative

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


def sensitivities(
    parameters: ParameterSet,
    record: Record,
    driver: Driver,
    start: Start,
    names: Sequence[str] | None,
) -> Sensitivities:
    """Derivatives by some columns; see `Drive.sensitivities` and `Drive.sensitivities_current`."""
    chosen = ALL_COLUMNS if driver == "voltage" else PUMP_COLUMNS
    if names is not None:
        if isinstance(names, str) or not names:
            raise InputError("Name at least one parameter to differentiate by, in a list.")
        chosen = tuple(columns_of(list(names)))
    foreign = [name for name in chosen if PATHS[name].startswith("card.")]
    if foreign and driver == "current":
        raise InputError(
            f"{foreign[0]} belongs to the card, which a given current does not go through."
        )
    run = simulate_drive(parameters, record, start, driver=driver)
    return Sensitivities(run, chosen, parameters, start)
