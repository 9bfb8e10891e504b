"""What a model must do to be fitted: simulate an experiment for given values of its unknowns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Experiment
from swashplate.errors import DomainError, InputError

Array = NDArray[np.float64]


class Model(Protocol):
    """A model of the machine; with `simulate` alone it is differentiated by central differences.

    Examples
    --------
    >>> class Lag:
    ...     def simulate(self, values, experiment):
    ...         speed = values["gain"] * filtered(experiment.input, values["time constant"])
    ...         return {"speed": np.interp(experiment["speed"].time, experiment.input.time, speed)}
    """

    def simulate(self, values: Mapping[str, float], experiment: Experiment) -> Mapping[str, Array]:
        """Simulate what an experiment measured.

        Parameters
        ----------
        values : mapping
            The unknowns by name, in their units.
        experiment : Experiment
            Its input drives the model; the model does not look at what was measured.

        Returns
        -------
        mapping of str to (m,) array
            For each channel that the model has, its samples at the channel's time stamps, SI.

        Raises
        ------
        DomainError
            If the model does not hold for these values; the fit takes the step back.
        """
        ...


class Linearised(NamedTuple):
    """A channel's simulated samples and their derivatives."""

    values: Array
    """(m,)"""
    by: Array
    """(m, k) derivatives by the names asked for, in their order."""


@runtime_checkable
class Differentiable(Protocol):
    """A model that knows its derivatives."""

    def linearise(
        self, values: Mapping[str, float], experiment: Experiment, names: Sequence[str]
    ) -> Mapping[str, Linearised]:
        """Simulate with derivatives by some of the unknowns; otherwise as `Model.simulate`."""
        ...


class Reduced(NamedTuple):
    """An experiment's weighted residuals and derivatives, as a triangular factor."""

    triangle: Array
    """(k+1, k+1) factor R of [J r], r the weighted residuals simulated less measured."""


@runtime_checkable
class Reducing(Protocol):
    """A model that gives the triangular factor of [J r] without ever holding J."""

    def reduce(
        self,
        values: Mapping[str, float],
        experiment: Experiment,
        names: Sequence[str],
        weights: Mapping[str, Array],
    ) -> Reduced:
        """Triangular factor by some of the unknowns.

        Parameters
        ----------
        values, experiment, names :
            As in `Differentiable.linearise`.
        weights : mapping of str to (m,) array
            Channels that count, and the factors on their residuals.
        """
        ...


RELATIVE_STEP = 1e-6
"""Step of the central differences, in units of each number's size."""


def linearised(
    model: Model, values: Mapping[str, float], experiment: Experiment, names: Sequence[str]
) -> Mapping[str, Linearised]:
    """Simulation with derivatives: the model's own, or central differences.

    Parameters
    ----------
    model : Model
        With or without `linearise`.
    values, experiment, names :
        As in `Differentiable.linearise`.

    Raises
    ------
    DomainError
        If the model does not hold there, or yields a number that is not finite.
    InputError
        If it returns something else than it must.
    """
    if isinstance(model, Differentiable):
        made = model.linearise(values, experiment, names)
        _check_mapping(made, experiment, "linearise", "a Linearised")
        for channel, part in made.items():
            shape = (*experiment[channel].time.shape, len(names))
            if not isinstance(part, Linearised):
                raise InputError(
                    f"{experiment.name}: linearise must return a Linearised for {channel}, not "
                    f"{_said(part)}."
                )
            _check_array(part.values, experiment, channel, shape[:1], "linearise")
            _check_array(part.by, experiment, channel, shape, "linearise")
        return made
    middle = simulated(model, values, experiment)
    columns: dict[str, list[Array]] = {channel: [] for channel in middle}
    for name in names:
        step = RELATIVE_STEP * max(abs(values[name]), 1e-3)
        above = simulated(model, {**values, name: values[name] + step}, experiment)
        below = simulated(model, {**values, name: values[name] - step}, experiment)
        for channel, column in columns.items():
            column.append((above[channel] - below[channel]) / (2.0 * step))
    return {
        channel: Linearised(
            middle[channel],
            np.column_stack(column) if column else np.zeros((middle[channel].size, 0)),
        )
        for channel, column in columns.items()
    }


def simulated(
    model: Model, values: Mapping[str, float], experiment: Experiment
) -> Mapping[str, Array]:
    """What a model simulates, checked.

    Raises
    ------
    DomainError
        If a number is not finite.
    InputError
        If what it returns is no array of real numbers for each channel, one a sample.
    """
    outputs = model.simulate(values, experiment)
    _check_mapping(outputs, experiment, "simulate", "an array of floats")
    for name, output in outputs.items():
        channel = experiment[name]
        _check_array(output, experiment, name, channel.time.shape, "simulate")
        if not np.isfinite(output).all():
            row = int(np.argmax(~np.isfinite(output)))
            raise DomainError(
                f"{experiment.name}: the model gives {output[row]} for {name} at "
                f"{channel.time[row]:g} s."
            )
    return outputs


def _check_mapping(made: object, experiment: Experiment, method: str, each: str) -> None:
    if not isinstance(made, Mapping):
        raise InputError(
            f"{experiment.name}: {method} must return a mapping of channel names to {each}, such "
            f"as {{'{next(iter(experiment.channels), 'speed')}': ...}}, not {_said(made)}."
        )


def _check_array(
    made: object, experiment: Experiment, name: str, shape: tuple[int, ...], method: str
) -> None:
    if not isinstance(made, np.ndarray) or made.dtype.kind not in "fiu":
        raise InputError(
            f"{experiment.name}: {method} must return a NumPy array of real numbers for {name}, "
            f"not {_said(made)}."
        )
    if made.shape != shape:
        columns = "" if len(shape) == 1 else ", and a column for each name asked for"
        raise InputError(
            f"{experiment.name}: {method} returns an array of shape {made.shape} for {name}, but "
            f"must return {shape}: a row for each of the channel's own time stamps{columns}."
        )


def _said(made: object) -> str:
    """What something is, in words."""
    if made is None:
        return "None (is a return missing?)"
    if isinstance(made, np.ndarray):
        return f"an array of {made.dtype.name}"
    return f"a {type(made).__name__}"
