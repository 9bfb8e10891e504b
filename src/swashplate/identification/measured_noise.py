"""The noise of a campaign's sensors: as it is stated, or as a fitted drive's residuals show it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from swashplate.errors import InputError
from swashplate.identification.linearised import LinearisedFit
from swashplate.identification.linearising import linearised_fit
from swashplate.identification.problem import Problem
from swashplate.identification.sensors import Sensor
from swashplate.identification.uncertainty import uncertainty

NOISELESS = 1e-9
"""Residuals, over their channel's noise, that are rounding."""
FARTHEST = 0.05
"""Residuals, over the range of what is measured, of a drive that nobody would call fitted."""


def measured_sensors(
    problem: Problem, machine: Sequence[int], *, fitted: bool
) -> dict[str, Sensor]:
    """The campaign's own sensors, by channel.

    Parameters
    ----------
    problem : Problem
        The tests, begun at the drive's values.
    machine : sequence of int
        Places of the unknowns that belong to no single run.
    fitted : bool
        Whether the residuals of that drive are noise; else it is as the campaign states.

    Raises
    ------
    InputError
        If the residuals are zero, or so large that the drive was not fitted to these tests.
    """
    kinds = {
        name: each[name].kind
        for each in problem.experiments
        for name in problem.channels
        if name in each.channels
    }
    if not fitted:
        return {
            name: Sensor(kind, problem.scales[name], origin="as in the campaign")
            for name, kind in kinds.items()
        }
    fit = _zeroed(problem, machine)
    made = {}
    for name, kind in kinds.items():
        ours = [run for run in fit.runs if run.channel == name]
        residual = np.concatenate([run.residual for run in ours])
        deviation = float(np.sqrt(np.mean(residual**2)))
        if not deviation > NOISELESS:
            raise InputError(
                f"The residuals of '{name}' are as good as zero: without noise any test is perfect."
            )
        reached = [each[name].values for each in problem.experiments if name in each.channels]
        whole = max(float(np.ptp(each)) for each in reached)
        noise = problem.scales[name] * deviation
        if noise > FARTHEST * whole:
            share = 100.0 * noise / whole
            raise InputError(
                f"The drive misses '{name}' by {share:.2g} % of its range, so that its residuals "
                "are no noise; give a drive that was fitted to these tests, or none."
            )
        alone = replace(fit, runs=tuple(ours))
        told = uncertainty(alone)
        # not of all that the residuals hold, but of what meets the unknowns' derivatives
        worth = float(np.median(told.inflation[told.own.determined]))
        memory = worth * interval(problem, name)
        made[name] = Sensor(kind, noise, memory, "residuals of the drive")
    return made


def _zeroed(problem: Problem, machine: Sequence[int]) -> LinearisedFit:
    """The tests at the drive's values, the free zeros and other unknowns of single runs fitted."""
    fit = linearised_fit(problem, problem.start)
    runs = []
    for run in fit.runs:
        own = np.delete(run.jacobian, list(machine), axis=1)
        shift = np.linalg.lstsq(own, -run.residual, rcond=None)[0]
        runs.append(run._replace(residual=run.residual + own @ shift))
    return replace(fit, runs=tuple(runs))


def interval(problem: Problem, channel: str) -> float:
    """Median interval between samples of a channel. [s]"""
    return float(
        np.median(
            np.concatenate(
                [
                    np.diff(each[channel].time)
                    for each in problem.experiments
                    if channel in each.channels and each[channel].time.size > 1
                ]
            )
        )
    )
