"""Derivatives of a whole run: of any signal, by parameters and by where the state begins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Generic, TypeVar, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import DomainError
from swashplate.machine.marching.derivatives import BoundModel
from swashplate.machine.marching.inputs import Command, inputs_of
from swashplate.machine.marching.observation import RunValues, every_sample
from swashplate.machine.marching.record import Sampling
from swashplate.machine.marching.run import Machine, Start, initial_states
from swashplate.machine.marching.simulation import Run
from swashplate.machine.model import parameter_paths

Array = NDArray[np.float64]
R = TypeVar("R", bound=Run, covariant=True)


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivities(Generic[R]):
    """Exact derivatives of a run's signals by parameters, a column for each of `names`.

    Read by the signal's name: ``by["shaft_speed"]`` has (n, k) derivatives, in the output's unit
    over the parameter's, both SI. At a switch (the edge of a dead zone, a limit just reached) they
    are the one-sided derivatives that the equations declare.

    Raises
    ------
    InputError
        On reading, if the model has no such signal.
    DomainError
        On reading, if the model leaves its domain, or a number or a derivative overflows.

    Examples
    --------
    >>> from swashplate import Drive, maneuvers
    >>> sensitivities = Drive.preset("hoist").sensitivities(maneuvers.step(9.0))
    >>> sensitivities["shaft_speed"].shape == (5121, len(sensitivities.names))
    True
    """

    run: R
    """The run, with the same numbers as without derivatives; marched when it is first read."""
    names: tuple[str, ...]
    """Columns, in the order asked for."""
    bound: BoundModel
    """The model with its numbers, and the columns as its paths."""
    computed: dict[str, Array] = field(default_factory=dict)
    """Derivatives of the signals that were read so far."""

    def __repr__(self) -> str:
        count = f"{len(self.names)} parameter{'' if len(self.names) == 1 else 's'}"
        return f"{type(self).__name__}({self.run!r}, by {count})"

    def __getitem__(self, signal: str) -> Array:
        """(n, k) derivatives of a signal downstream of the input, by its name."""
        if signal not in self.computed:
            (driver, record), *others = self.run.records.items()
            measured_values = {name: stamped.values for name, stamped in others}
            observed = every_sample(record, signal, driver, self.run.start, measured_values)
            columns = self.bound.jacobian(observed).columns
            self._check(signal, columns)
            self.computed[signal] = columns
        return self.computed[signal]

    def _check(self, signal: str, columns: Array) -> None:
        """Refuse derivatives that are not finite; the first is named."""
        with np.errstate(all="ignore"):
            if isfinite(columns.sum()):  # of finite numbers it may overflow, of others it does not
                return
        bad = ~np.isfinite(columns)
        if not bad.any():
            return
        sample = int(np.argmax(bad.any(axis=1)))
        column = int(np.argmax(bad[sample]))
        raise DomainError(
            f"{self.run.name}: the derivative of {signal} by {self.names[column]} is "
            f"{columns[sample, column]} at sample {sample}: check the size of the parameters."
        )


def sensitivities(
    machine: Machine,
    inputs: Mapping[str, ArrayLike | Command],
    rate: float,
    *,
    parameters: Sequence[str] | None = None,
    start: Start = "rest",
    begin: Mapping[str, float] | None = None,
    **sampling: Unpack[Sampling],
) -> Sensitivities[Run]:
    """Exact derivatives of a model's signals by parameters, and by where the state begins.

    Parameters
    ----------
    machine, inputs, rate, start, begin, **sampling :
        As in `simulate`; `time`, `interpolation`, `substeps`.
    parameters : sequence of str, optional
        Paths of parameters, whose last word is enough where it is unique, symbols for both
        directions, or ``start.`` with the path of a state that `begin` names; by default all
        parameters.

    Returns
    -------
    Sensitivities
        Derivatives by signal, ``by["position"]``, (n, k), and the run.

    Raises
    ------
    InputError
        For inputs or names that do not fit the model.
    """
    model = machine.model
    records = inputs_of(machine, inputs, rate, **sampling)
    run = Run(machine, records, start, begin or {})
    machine.check_step(run.record.step)
    initial_states(machine, run.initial, run.begin)  # refuses what does not fit
    columns = parameter_paths(model)
    if parameters is not None:
        starts = [f"start.{path}" for path in run.begin]
        columns = tuple(
            path
            for name in parameters
            for path in ((name,) if name in starts else model.parameters_named(name))
        )
    return Sensitivities(run, columns, BoundModel(machine, RunValues(run.begin), columns))
