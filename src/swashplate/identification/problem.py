"""The problem of a fit: a model, experiments, unknowns and weights; residuals and derivatives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Channel, Experiment
from swashplate.equations import Model as OfEquations
from swashplate.errors import InputError
from swashplate.identification.model import (
    OFFSET,
    EquationModel,
    Linearised,
    Model,
    OwnModel,
    linearised,
    simulated,
)
from swashplate.identification.solving import Evaluation
from swashplate.identification.unknowns import Unknowns
from swashplate.results import Result

Array = NDArray[np.float64]
Part = TypeVar("Part")


@dataclass(frozen=True)
class Problem(Result):
    """Half the weighted sum of squares of all experiments, as a function of the unknowns.

    The residual of a sample is sqrt(weight)/scale times (simulated less measured).
    """

    model: Model
    """One of equations stands for itself, or as an `OwnModel` with more said about it."""
    experiments: tuple[Experiment, ...]
    unknowns: Unknowns
    channels: tuple[str, ...]
    """Names of the channels that are fitted."""
    scales: Mapping[str, float]
    """What one unit of residual is, by channel: its noise, in its unit."""
    fixed: Mapping[str, float] = field(default_factory=dict)
    """Values of the model's names that are not unknown but differ from the model's own."""
    uncertain: tuple[Mapping[str, float], ...] = ()
    """Standard uncertainties of fixed numbers, by the model's names; those of one mapping are off
    together. [unit]"""
    threads: int = 1
    """Threads over experiments, for a model that releases the interpreter's lock."""
    compare: Callable[[Channel, Array], Array] | None = None
    """Linear map of a channel's samples, (m,) or (m, k), before they are compared: a position that
    drifts by its motion since the last anchor, for example."""

    def __post_init__(self) -> None:
        if isinstance(self.model, OfEquations):
            object.__setattr__(self, "model", OwnModel(self.model))
        if not self.unknowns:
            raise InputError("A fit needs at least one unknown.")
        if not self.experiments:
            raise InputError("A fit needs at least one experiment.")
        if not any(weight.any() for run in self.weights for weight in run.values()):
            raise InputError(
                f"No sample of {', '.join(self.channels) or 'any channel'} counts: all are ignored "
                "or there are none."
            )

    @property
    def start(self) -> Array:
        """(K,) nominal vector."""
        return self.unknowns.start

    @property
    def bounds(self) -> tuple[Array, Array]:
        """(K,) bounds of the vector."""
        return self.unknowns.bounds

    @cached_property
    def weights(self) -> tuple[Mapping[str, Array], ...]:
        """For each experiment and fitted channel the (m,) factors on the residuals."""
        return tuple(
            {
                name: np.sqrt(each[name].weight) / self.scales[name]
                for name in self.channels
                if name in each.channels
            }
            for each in self.experiments
        )

    @property
    def samples(self) -> int:
        """Samples that count."""
        return sum(int(np.count_nonzero(w)) for run in self.weights for w in run.values())

    def evaluate(self, vector: Array, *, compressed: bool = True) -> Evaluation:
        """Residuals and Jacobian by the vector, see `solving.Objective`."""
        if compressed and self.compare is None and isinstance(self.model, EquationModel):
            parts = self._each(lambda k: self._reduced(vector, k))
        else:
            parts = self._each(lambda k: self._full(vector, k))
        residuals, rows = self.unknowns.prior_rows(vector)
        return Evaluation(
            np.concatenate([*(part.residuals for part in parts), residuals]),
            np.vstack([*(part.jacobian for part in parts), rows]),
        )

    def cost(self, vector: Array) -> float:
        """Half the sum of squares."""
        residuals, _ = self.unknowns.prior_rows(vector)
        costs = self._each(lambda k: float(np.sum(self.residuals(vector, k) ** 2)))
        return 0.5 * (sum(costs) + float(residuals @ residuals))

    def outputs(self, vector: Array, number: int) -> Mapping[str, Array]:
        """Simulated samples of the fitted channels of one experiment, offsets included."""
        experiment = self.experiments[number]
        values, own = self._values(vector, number), self.model_values(vector, number)
        outputs = simulated(self.model, own, experiment)
        return {
            name: self._output(outputs, experiment, name) + values.get(f"{OFFSET}{name}", 0.0)
            for name in self.weights[number]
        }

    def residuals(self, vector: Array, number: int) -> Array:
        """Weighted residuals of one experiment, channel after channel, ignored samples as 0."""
        outputs, experiment = self.outputs(vector, number), self.experiments[number]
        return np.concatenate(
            [
                weight * self._compared(experiment[name], outputs[name] - experiment[name].values)
                for name, weight in self.weights[number].items()
            ]
        )

    def linearised(self, vector: Array, number: int) -> Mapping[str, Linearised]:
        """Weighted residuals of each channel of one experiment and derivatives by the vector."""
        experiment = self.experiments[number]
        values, own = self._values(vector, number), self.model_values(vector, number)
        names = self._names(number)
        inner = [name for name in names if name in own]
        outputs = linearised(self.model, own, experiment, inner)
        chain = self.unknowns.chain(vector, names, experiment.name)
        made = {}
        for name, weight in self.weights[number].items():
            output = self._output(outputs, experiment, name)
            by = np.zeros((weight.size, len(names)))
            by[:, [names.index(each) for each in inner]] = output.by
            offset = f"{OFFSET}{name}"
            if offset in names:
                by[:, names.index(offset)] = 1.0
            shifted = output.values + values.get(offset, 0.0) - experiment[name].values
            made[name] = Linearised(
                weight * self._compared(experiment[name], shifted),
                weight[:, None] * self._compared(experiment[name], by @ chain),
            )
        return made

    def _compared(self, channel: Channel, rows: Array) -> Array:
        return rows if self.compare is None else self.compare(channel, rows)

    def _full(self, vector: Array, number: int) -> Evaluation:
        parts = self.linearised(vector, number).values()
        return Evaluation(
            np.concatenate([part.values for part in parts]), np.vstack([part.by for part in parts])
        )

    def _reduced(self, vector: Array, number: int) -> Evaluation:
        experiment = self.experiments[number]
        names = self._names(number)
        assert isinstance(self.model, EquationModel)
        triangle = self.model.reduce(
            self._values(vector, number), experiment, names, self.weights[number]
        )
        chain = self.unknowns.chain(vector, names, experiment.name)
        return Evaluation(triangle[:, -1], triangle[:, :-1] @ chain)

    def model_values(self, vector: Array, number: int) -> dict[str, float]:
        """Values by the model's names for one experiment; a channel's zero is none of them."""
        zeros = {f"{OFFSET}{name}" for name in self.channels}
        values = self._values(vector, number)
        return {name: value for name, value in values.items() if name not in zeros}

    def _values(self, vector: Array, number: int) -> dict[str, float]:
        return {**self.fixed, **self.unknowns.targets(vector, self.experiments[number].name)}

    def _names(self, number: int) -> list[str]:
        """Names in the model that the unknowns of one experiment set."""
        run = self.experiments[number].name
        return [
            target for each in self.unknowns if each.run in (None, run) for target in each.targets
        ]

    @staticmethod
    def _output(outputs: Mapping[str, Part], experiment: Experiment, name: str) -> Part:
        if name not in outputs:
            raise InputError(
                f"{experiment.name}: the model gives no '{name}'; it gives {', '.join(outputs)}."
            )
        return outputs[name]

    def _each(self, work: Callable[[int], Part]) -> list[Part]:
        numbers = range(len(self.experiments))
        if self.threads == 1:
            return [work(number) for number in numbers]
        from concurrent.futures import ThreadPoolExecutor

        with ThreadPoolExecutor(self.threads) as pool:
            return list(pool.map(work, numbers))


def noise_scales(experiments: Sequence[Experiment], channels: Sequence[str]) -> dict[str, float]:
    """What one unit of residual is, by channel.

    A noise that is stated; or the rounding of an encoder; or 1 % of the range in all runs.

    Raises
    ------
    InputError
        If a channel is in no experiment, or never changes.
    """
    scales = {}
    for name in channels:
        having: list[Channel] = [each[name] for each in experiments if name in each.channels]
        if not having:
            known = ", ".join(dict.fromkeys(c for each in experiments for c in each.channels))
            raise InputError(f"No experiment has a channel '{name}'; there are {known}.")
        stated = [each.noise for each in having if each.noise is not None]
        if stated:
            scales[name] = float(np.sqrt(np.mean(np.square(stated))))
            continue
        if having[0].encoder is not None:
            # rounding to whole counts leaves an error between -1/2 and 1/2 of one
            scales[name] = abs(having[0].encoder.angle_per_count) / np.sqrt(12.0)
            continue
        # an ignored spike says nothing of the range
        used = [each.values[each.used] for each in having if each.used.any()]
        scales[name] = 0.01 * max((float(np.ptp(each)) for each in used), default=0.0)
        if scales[name] == 0.0:
            raise InputError(f"The channel '{name}' never changes: nothing can be fitted to it.")
    return scales
