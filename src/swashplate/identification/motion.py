"""What runs did, measured and as the nominal drive has it, side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign.experiment import Channel, Experiment
from swashplate.identification.drive_model import SIGNALS
from swashplate.simulation.result import Simulation

Array = NDArray[np.float64]

WINDOW = 0.2
"""Time over which the speed behind a position is taken. [s]"""
MOVING = 0.1
"""Of the largest motion in any run, from which a run's own can be judged."""


class Motion(NamedTuple):
    """What a channel did in a run, measured and simulated, where it counts."""

    experiment: Experiment
    channel: Channel
    time: Array
    """(n,) [s]"""
    measured: Array
    """(n,) of a position its mean speeds. [unit]"""
    simulated: Array
    """(n,) the nominal drive's. [unit]"""

    @property
    def unit(self) -> str:
        """Of what is compared."""
        return f"{self.channel.unit}/s" if self.channel.is_position else self.channel.unit

    @property
    def gain(self) -> float:
        """Measured over simulated, in the least-squares sense; negative where turned round."""
        return float(self.measured @ self.simulated / (self.simulated @ self.simulated))

    @property
    def correlation(self) -> float:
        """Of measured and simulated about zero, -1 to 1."""
        size = float(np.linalg.norm(self.measured) * np.linalg.norm(self.simulated))
        return float(self.measured @ self.simulated) / size if size > 0.0 else 0.0


def motions(
    experiments: Sequence[Experiment], simulations: Mapping[str, Simulation]
) -> dict[str, list[Motion]]:
    """What each channel did in each run, by the channel's name; runs that hardly move left out.

    Parameters
    ----------
    experiments : sequence of Experiment
        The runs.
    simulations : mapping of str to Simulation
        The nominal drive in each, by the run's name.
    """
    found: dict[str, list[Motion]] = {}
    for experiment in experiments:
        for name, channel in experiment.channels.items():
            used = channel.used
            signal = _signal(channel, experiment)
            if signal is None or np.count_nonzero(used) < 2:
                continue
            time, measured = channel.time[used], channel.values[used]
            simulated = _simulated(simulations[experiment.name], signal, time)
            if channel.is_position:
                time, measured, simulated = _mean_speeds(time, measured, simulated)
            found.setdefault(name, []).append(
                Motion(experiment, channel, time, measured, simulated)
            )
    return {name: _moving(each) for name, each in found.items()}


def _signal(channel: Channel, experiment: Experiment) -> str | None:
    if experiment.input.kind == "current" and "current" in channel.kind:
        return None
    return SIGNALS.get(channel.kind)


def _simulated(simulation: Simulation, signal: str, time: Array) -> Array:
    if signal == "current_sum":
        plus, minus = (simulation.at(time, f"current_{side}") for side in ("positive", "negative"))
        return plus + minus
    return simulation.at(time, signal)


def _mean_speeds(time: Array, *positions: Array) -> tuple[Array, ...]:
    """Middles of short windows and mean speeds in them: where a position drifts to says little."""
    windows = max(int((time[-1] - time[0]) / WINDOW), 4)
    grid = np.linspace(time[0], time[-1], windows + 1)
    speeds = (np.diff(np.interp(grid, time, each)) / np.diff(grid) for each in positions)
    return 0.5 * (grid[1:] + grid[:-1]), *speeds


def _moving(found: Sequence[Motion]) -> list[Motion]:
    sizes = [rms(each.simulated) for each in found]
    least = MOVING * max(sizes)
    return [each for each, size in zip(found, sizes, strict=True) if size > 0.0 and size >= least]


def rms(values: Array) -> float:
    """Root mean square; 0 of nothing."""
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else 0.0
