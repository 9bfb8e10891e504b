"""A drive with refinements as a model to be fitted: simulated plainly, differentiated by steps.

The march that carries exact derivatives along does not know the refinements. What it answers for
the others is answered here by simulation alone and by differences of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swashplate.identification.linearised import triangular_factor
from swashplate.identification.model import Linearised, Reduced
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.refinements import REFINEMENTS
from swashplate.simulation.observation import ObservedRecord, Own
from swashplate.simulation.refined import simulate_refined_drive, simulate_refined_pump

Array = NDArray[np.float64]

STEP = 1e-6
"""Step of the differences, as a part of each unknown's size."""


def is_refined(parameters: ParameterSet, names: Mapping[str, object]) -> bool:
    """Whether a refinement is on, or among the unknowns and may come on."""
    return bool(parameters.refinements) or not REFINEMENTS.keys().isdisjoint(names)


def refined_outputs(parameters: ParameterSet, observed: ObservedRecord, own: Own) -> Array:
    """What is simulated of all observations at their stamps, one after the other.

    Parameters
    ----------
    parameters : ParameterSet
        The drive; its refinements may all be off.
    observed : ObservedRecord
        The record, and what was measured under it: without poles.
    own : Own
        Values of the experiment's own unknowns; its offsets are left out.

    Raises
    ------
    DomainError
        If the model does not hold there.
    InputError
        If the card's filter is unstable at this step.
    """
    by_voltage = observed.driven_by == "voltage"
    simulate = simulate_refined_drive if by_voltage else simulate_refined_pump
    run = simulate(parameters, observed.record, observed.start, own.start_pressure)
    grid = observed.record.start + np.arange(run.pressure.size) * observed.record.step
    clocks = own.clock_offsets or (0.0,) * len(observed.observations)
    return np.concatenate(
        [
            np.interp(np.asarray(each.time) + clock - each.delay, grid, run.fine(each.signal))
            for each, clock in zip(observed.observations, clocks, strict=True)
        ]
    )


@dataclass(frozen=True, eq=False)
class Differences:
    """Derivatives of an experiment's outputs, by differences of simulations."""

    outputs: Callable[[Mapping[str, float]], Array]
    """From the unknowns by name to all simulated samples, one channel after the other."""
    observed: ObservedRecord
    channels: Sequence[str]
    """Names of the observations."""
    sizes: Mapping[str, float]
    """What counts as a change of each unknown, where its value is small."""

    def split(self, flat: Array) -> dict[str, Array]:
        """Rows of each channel."""
        return {name: flat[self.observed.rows_of(k)] for k, name in enumerate(self.channels)}

    def columns(self, values: Mapping[str, float], names: Sequence[str]) -> Array:
        """(m, k) derivatives by some of the unknowns: central, of second order.

        At a refinement's lower limit, where it is off, they are one-sided, of the same order.
        """
        columns = []
        for name in names:
            value = values[name]
            # next to 0 a part of the value would be lost in rounding
            step = STEP * (max(abs(value), 1e-3 * self.sizes.get(name, 0.0)) or 1.0)

            def at(
                steps: float, name: str = name, value: float = value, step: float = step
            ) -> Array:
                return self.outputs({**values, name: value + steps * step})

            if name in REFINEMENTS and value - step < REFINEMENTS[name].lower:
                column = 4.0 * at(1.0) - 3.0 * at(0.0) - at(2.0)
            else:
                column = at(1.0) - at(-1.0)
            columns.append(column / (2.0 * step))
        return np.column_stack(columns) if columns else np.zeros((self.observed.rows, 0))

    def linearise(self, values: Mapping[str, float], names: Sequence[str]) -> dict[str, Linearised]:
        """As `model.Differentiable.linearise`."""
        middle = self.split(self.outputs(values))
        by = self.split(self.columns(values, names))
        return {name: Linearised(middle[name], by[name]) for name in self.channels}

    def reduce(self, values: Mapping[str, float], names: Sequence[str]) -> Reduced:
        """As `model.Reducing.reduce`, with the weights of the observations."""
        inner = [name for name in names if not name.startswith("offset ")]
        found = self.linearise(values, inner)
        blocks = []
        for name, each in zip(self.channels, self.observed.observations, strict=True):
            weight, measured = np.asarray(each.weight), np.asarray(each.values)
            block = np.zeros((weight.size, len(names) + 1))
            block[:, [names.index(each) for each in inner]] = found[name].by
            offset = f"offset {name}"
            if offset in names:
                block[:, names.index(offset)] = 1.0
            residual = found[name].values + values.get(offset, 0.0) - measured
            block[:, -1] = np.where(weight > 0.0, residual, 0.0)
            blocks.append(weight[:, None] * block)
        return Reduced(triangular_factor(np.vstack(blocks)))
