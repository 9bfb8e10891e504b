"""Outcomes: what a drive made of a command, one number each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.trial import Trial
from swashplate.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Outcome:
    """One number that says what a drive made of a command."""

    name: str
    unit: str
    meaning: str
    undefined: str
    """Why there may be none, as a half sentence."""
    compute: Callable[[Array, Trial], Array]
    """From (m, n) speeds [rad/s] and the command to (m,) numbers, NaN where there is none."""


def outcome_matrix(speed: Array, trial: Trial, outcomes: Sequence[Outcome]) -> Array:
    """Outcomes of some drives.

    Parameters
    ----------
    speed : (m, n) array
        Of the shaft under the trial's command, one drive a row. [rad/s]
    trial : Trial
        The command.
    outcomes : sequence of Outcome
        K of them.

    Returns
    -------
    (m, K) array
        In the outcomes' units; NaN where there is none; `Outcome.undefined` says why.
    """
    return np.column_stack([each.compute(speed, trial) for each in outcomes])


def find_outcomes(names: Sequence[str]) -> tuple[Outcome, ...]:
    """Outcomes by name.

    Raises
    ------
    InputError
        If there is none of a name, or none is named.
    """
    if not names:
        raise InputError(f"Name at least one outcome: {', '.join(OUTCOMES)}.")
    return tuple(_find(name) for name in dict.fromkeys(names))


def _find(name: str) -> Outcome:
    if name not in OUTCOMES:
        close = get_close_matches(name, OUTCOMES, n=1)
        hint = f" (did you mean {close[0]}?)" if close else ""
        raise InputError(
            f"There is no outcome '{name}'{hint}; the outcomes are {', '.join(OUTCOMES)}."
        )
    return OUTCOMES[name]


def _final_speed(speed: Array, trial: Trial) -> Array:
    return np.array(speed[:, trial.held])


def _peak_speed(speed: Array, trial: Trial) -> Array:
    peak: Array = np.maximum(speed.max(axis=1), -speed.min(axis=1))
    return peak


def _rise_time(speed: Array, trial: Trial) -> Array:
    late, early = _reached(speed, trial, 0.9), _reached(speed, trial, 0.1)
    return late - early


def _response_time(speed: Array, trial: Trial) -> Array:
    return _reached(speed, trial, 0.9)


def _reached(speed: Array, trial: Trial, part: float) -> Array:
    """(m,) time from the command's first move to a part of the final speed. [s]"""
    rising = speed[:, trial.begin : trial.held + 1]
    final = rising[:, -1]
    share = rising * np.sign(final)[:, None] - part * np.abs(final)[:, None]
    after = np.argmax(share >= 0.0, axis=1)  # the last sample always is
    rows, before = np.arange(len(speed)), np.maximum(after - 1, 0)
    low, high = share[rows, before], share[rows, after]
    rise = np.where(high > low, high - low, 1.0)
    samples = np.where(after > 0, before + np.clip(-low / rise, 0.0, 1.0), 0.0)
    time: Array = np.where(final != 0.0, samples / trial.rate, np.nan)
    return time


def _largest_acceleration(speed: Array, trial: Trial) -> Array:
    change = np.diff(speed, axis=1)
    largest: Array = np.maximum(change.max(axis=1), -change.min(axis=1)) * trial.rate
    return largest


def _overshoot(speed: Array, trial: Trial) -> Array:
    rising = speed[:, trial.begin : trial.held + 1]
    final = rising[:, -1]
    peak = np.where(final > 0.0, rising.max(axis=1), -rising.min(axis=1))
    size = np.abs(final)
    beyond: Array = np.where(size > 0.0, peak / np.where(size > 0.0, size, 1.0) - 1.0, np.nan)
    return beyond


def _tracking_error(speed: Array, trial: Trial) -> Array:
    error = speed - trial.wanted
    rms: Array = np.sqrt(np.einsum("ij,ij->i", error, error) / error.shape[1])
    return rms


def _creep(speed: Array, trial: Trial) -> Array:
    if not trial.rests:
        return np.full(len(speed), np.nan)
    return np.array(speed[:, trial.begin])


def _travel(speed: Array, trial: Trial) -> Array:
    inner = speed.sum(axis=1) - 0.5 * (speed[:, 0] + speed[:, -1])
    travel: Array = inner / trial.rate
    return travel


_NEVER = "the shaft stands still while the command is at its largest"
_ALL = (
    Outcome(
        "final_speed",
        "rad/s",
        "Speed at the last moment at which the command is at its largest.",
        "",
        _final_speed,
    ),
    Outcome("peak_speed", "rad/s", "Largest speed, either way.", "", _peak_speed),
    Outcome(
        "rise_time",
        "s",
        "Time from 10 % to 90 % of the final speed.",
        _NEVER,
        _rise_time,
    ),
    Outcome(
        "response_time",
        "s",
        "Time from the command's first move to 90 % of the final speed.",
        _NEVER,
        _response_time,
    ),
    Outcome(
        "largest_acceleration",
        "rad/s^2",
        "Largest change of speed from sample to sample, either way.",
        "",
        _largest_acceleration,
    ),
    Outcome(
        "overshoot",
        "1",
        "How far the speed goes beyond the final one, as a part of it.",
        _NEVER,
        _overshoot,
    ),
    Outcome(
        "tracking_error",
        "rad/s",
        "Root of the mean squared difference from the wanted speed.",
        "",
        _tracking_error,
    ),
    Outcome(
        "creep",
        "rad/s",
        "Speed just before the command first leaves zero.",
        "the command does not rest at 0 V long enough at its start",
        _creep,
    ),
    Outcome("travel", "rad", "How far the shaft has gone at the end.", "", _travel),
)

OUTCOMES: Mapping[str, Outcome] = {each.name: each for each in _ALL}
"""Outcomes by name."""
