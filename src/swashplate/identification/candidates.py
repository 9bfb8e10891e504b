"""Tests that could be made next: the usual manoeuvres, sensors to add, a plan of several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.identification.advice import WORTH, Advice, Candidate, Gain, advise
from swashplate.identification.bench import Bench
from swashplate.identification.linearised import TOLERANCE, triangular_factor
from swashplate.identification.sensors import Sensor
from swashplate.identification.variables import Variables
from swashplate.maneuvers import Maneuver, multisine, ramp, sine, stairs, step

Array = NDArray[np.float64]


def default_maneuvers() -> tuple[Maneuver, ...]:
    """Small and large, slow and fast, both ways: what to choose from where nothing is named."""
    both = (1.0, -1.0)
    up_and_down = (2.0, 4.0, 6.0, 8.0, 10.0, 8.0, 6.0, 4.0, 2.0, 0.0)
    return (
        *(step(sign * volts) for volts in (2.0, 5.0, 9.0) for sign in both),
        *(ramp(sign) for sign in both),
        *(
            replace(
                stairs([sign * volts + 0.0 for volts in up_and_down], 2.0),
                name=f"stairs to {10.0 * sign:g} V and back",
            )
            for sign in both
        ),
        stairs([5.0, -5.0, 5.0, -5.0, 0.0], 2.0),
        stairs([9.0, -9.0, 0.0], 3.0),
        *(sine(volts, 0.1, length=30.0) for volts in (2.0, 5.0, 9.0)),
        sine(9.0, 0.3, length=20.0),
        *(
            replace(
                multisine(volts, (0.05, 2.0, 8), length=60.0),
                name=f"multisine {volts:g} V 0.05 to 2 Hz",
            )
            for volts in (4.0, 9.0)
        ),
    )


class SensorAdvice(NamedTuple):
    """A sensor that could be added to a test."""

    sensor: Sensor
    maneuver: str
    """The test in which it would tell most."""
    advice: Advice
    """What it would add to that test with the sensors at hand."""


def judge_sensors(
    bench: Bench,
    maneuvers: Sequence[Maneuver],
    added: Sequence[Sensor],
    *,
    beside: Sequence[str] = (),
) -> tuple[SensorAdvice, ...]:
    """For each sensor the test in which it tells most, and what it adds there.

    Parameters
    ----------
    bench : Bench
        What is known so far.
    maneuvers : sequence of Maneuver
        Tests in which it could be read.
    added : sequence of Sensor
        To be judged, one by one.
    beside : sequence of str
        Names of manoeuvres that count as made where the bench has no tests yet.
    """
    known = [bench.present]
    if not len(bench.present):
        made = [each for each in maneuvers if each.name in beside]
        known += [bench.candidate(each, bench.sensors).rows for each in made]
    found = []
    for sensor in added:
        judged = []
        for maneuver in maneuvers:
            without = bench.candidate(maneuver, bench.sensors).rows
            more = Candidate(sensor.kind, bench.rows(maneuver, sensor), duration=maneuver.length)
            (advice,) = advise(np.vstack([*known, without]), [more], bench.variables)
            judged.append(SensorAdvice(sensor, maneuver.name, advice))
        found.append(min(judged, key=lambda each: each.advice.rank))
    return tuple(found)


def in_turn(
    present: Array,
    candidates: Sequence[Candidate],
    variables: Variables,
    count: int,
    *,
    tolerance: float = TOLERANCE,
) -> tuple[Advice, ...]:
    """A plan of tests: the best one, then the best beside it, and so on, each at most once.

    Parameters
    ----------
    present, candidates, variables, tolerance :
        As of `advise`.
    count : int
        Tests to choose; fewer if none of the others tells anything new.
    """
    left, chosen = list(candidates), list[Advice]()
    while left and len(chosen) < count:
        best = advise(present, left, variables, tolerance=tolerance)[0]
        if not best.newly_determined and not best.ranks and best.d_gain < 1.0 + WORTH:
            break
        taken = next(each for each in left if each.name == best.candidate)
        left.remove(taken)
        chosen.append(best)
        present = triangular_factor(np.vstack([present, taken.rows]))
    return tuple(chosen)


def best_for_each(judged: Sequence[Advice]) -> dict[str, tuple[str, Gain]]:
    """For each unknown the candidate after which its standard error is least, and the gain.

    Unknowns that none would tell more of are left out.
    """
    best: dict[str, tuple[str, Gain]] = {}
    for advice in judged:
        for gain in advice.gains:
            if gain.ratio < 1.0 - WORTH and (
                gain.name not in best or gain.after < best[gain.name][1].after
            ):
                best[gain.name] = (advice.candidate, gain)
    return best
