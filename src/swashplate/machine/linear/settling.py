"""Where a machine settles under constant inputs: by its own equations, or at the end of a march."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import DomainError, InputError
from swashplate.machine import Machine, Stepper, stepper
from swashplate.machine.fields import floats_of, tuple_from
from swashplate.machine.model import near_names, state_paths
from swashplate.results import Result

Array = NDArray[np.float64]
FIRST, LONGEST = 1.0, 1024.0
"""Time after which a machine may have settled, and must have. [s]"""
SETTLED, STEADY = 1e-9, 1e-6
"""Change of a state over its size that counts as none, and change of its rate over the rate. [1]"""


@dataclass(frozen=True, eq=False)
class SettledPoint(Result):
    """States of a machine under constant inputs."""

    machine: Machine
    flat: Array
    """All states, in the order of `swashplate.machine.state_paths`."""
    rates: Array
    """By which those change that go on, as a position under a constant speed does; else 0. [1/s]"""
    by_equation: bool = False
    """Whether the model's own equations give them."""

    @property
    def states(self) -> tuple[Any, ...]:
        """State of each part."""
        numbers = iter(self.flat.tolist())
        return tuple(
            tuple_from(part.state, {path: next(numbers) for path in floats_of(part.state)})
            for part in self.machine.model.parts
        )


def settles_by_equation(machine: Machine) -> bool:
    """Whether every part that remembers something has an equation for its steady state."""
    return all(part.settled or not floats_of(part.state) for part in machine.model.parts)


def settle(
    machine: Machine,
    at: Mapping[str, float],
    rate: float,
    *,
    begin: Mapping[str, float] | None = None,
) -> SettledPoint:
    """Where a machine settles under constant inputs.

    Parameters
    ----------
    machine : Machine
        A model with its numbers.
    at : mapping of str to float
        Constant inputs by name.
    rate : float
        Steps a second. [Hz]
    begin : mapping of str to float, optional
        Numbers of the state that a march begins with, by path; the others are those at rest.

    Returns
    -------
    SettledPoint
        By the model's equations `settled`; if a part has none, where a march ends once nothing
        changes but at a constant rate. A state that goes on, as a position does, keeps its
        beginning unless another state goes on with it.

    Raises
    ------
    InputError
        For an input or a state that the model does not have.
    DomainError
        If nothing settles within 1024 s, or the model leaves its domain.

    Examples
    --------
    >>> from swashplate import Drive, settle
    >>> point = settle(Drive.preset("hoist"), {"voltage": 9.0}, 512.0)
    >>> point.by_equation
    True
    """
    if settles_by_equation(machine):
        states = machine.start(at, 1.0 / rate, "steady").flat
        return SettledPoint(machine, states, np.zeros(states.size), by_equation=True)
    return _march_end(machine, at, rate, states_at_start(machine, at, rate, begin or {}))


def states_at_start(
    machine: Machine, at: Mapping[str, float], rate: float, begin: Mapping[str, float]
) -> Array:
    """All states at rest, but for those that are given by path."""
    paths = state_paths(machine.model)
    states = machine.start(at, 1.0 / rate, "rest").flat
    for path, value in begin.items():
        if path not in paths:
            raise InputError(f"{machine.name} has no state {near_names(path, paths)}.")
        states[paths.index(path)] = value
    return states


def _march_end(
    machine: Machine, at: Mapping[str, float], rate: float, begin: Array
) -> SettledPoint:
    """Where a march under constant inputs ends."""
    # all signals: a state that none of the outputs needs is not marched
    walker = stepper(machine, [*at], machine.model.every_signal, rate=rate)
    _put(walker, begin)
    steps = round(FIRST * rate)
    states, change = _after(walker, at, steps)
    while steps < LONGEST * rate:
        earlier, earlier_change = states, change
        states, change = _after(walker, at, steps)
        still = np.abs(states - earlier) <= SETTLED * np.maximum(np.abs(states), 1e-30)
        steady = np.abs(change - earlier_change) <= STEADY * np.abs(change)
        if (still | steady).all():
            break
        steps *= 2
    else:
        raise DomainError(
            f"{machine.name} does not settle within {LONGEST:g} s under these inputs: give the "
            "states of the operating point, in Python by states=, on the command line by --set "
            "start.PATH=VALUE."
        )
    lasting = np.where(still, 0.0, change)
    # a position goes on from where it begins, unless another state goes on with it
    from_start = np.where(still, states, begin)
    _put(walker, from_start)
    _, again = _after(walker, at, 0)
    largest = STEADY * np.abs(change).max(initial=0.0) + SETTLED * np.abs(states).max(initial=0.0)
    if np.abs(again - lasting).max(initial=0.0) <= largest:
        states = from_start
    return SettledPoint(machine, states, lasting * rate)


def _put(walker: Stepper[dict[str, float]], states: Array) -> None:
    """Give a stepper its states."""
    kept = walker.state
    kept.context.states[:] = states
    walker.state = kept


def _after(
    walker: Stepper[dict[str, float]], at: Mapping[str, float], steps: int
) -> tuple[Array, Array]:
    """States after some steps under constant inputs, and their change in the next one."""
    for _ in range(steps):
        walker.step(*at.values())
    before = walker.state.context.states.copy()
    walker.step(*at.values())
    return before, walker.state.context.states - before
