"""The band about a simulated speed in which the machine's own lies."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from swashplate.drive import Drive, Simulation, drive_sensitivities
from swashplate.identification.diagnostics.discrepancy import PredictionError
from swashplate.identification.diagnostics.verdict import Verdict
from swashplate.identification.estimation.posterior import Posterior
from swashplate.identification.validation import percent
from swashplate.results import Tabular
from swashplate.tables import quantity

if TYPE_CHECKING:
    import polars

Array = NDArray[np.float64]

SPEEDS = ("rad/s", "m/s")
"""Units of what moves: of a shaft, and of a rod."""
DEVIATIONS = 1.96
"""Half width of a band of 95 %, in standard deviations."""


@dataclass(frozen=True, eq=False)
class Band(Tabular):
    """Where a machine's speed lies beside the one that its fitted drive simulates.

    The half width h has two parts, h² = (1.96 σ)² + e²: σ is what the tests leave open of the
    drive's numbers, to first order (`Posterior`), and e the error of the model itself at such a
    speed and such a change of it, as runs show it that were not fitted (`PredictionError`).

    Examples
    --------
    >>> from swashplate import identify, maneuvers, rig
    >>> tests = rig.run("hoist", {"step": maneuvers.step(9.0), "sine": maneuvers.sine(9.0, 0.1)})
    >>> fit = identify(rig.write(tests, "tests"), "hoist")
    >>> band = fit.band(maneuvers.sine(5.0, 0.2))
    >>> bool((band.lower <= band.speed).all())
    True
    """

    time: Array
    """(n,) [s]"""
    speed: Array
    """(n,) of the shaft, as the fitted drive simulates it. [rad/s]"""
    half_width: Array
    """(n,) of a band of 95 %. [rad/s]"""
    reach: float
    """Range of the speed that the fitted runs had. [rad/s]"""

    @property
    def lower(self) -> Array:
        """(n,) lower end. [rad/s]"""
        return self.speed - self.half_width

    @property
    def upper(self) -> Array:
        """(n,) upper end. [rad/s]"""
        return self.speed + self.half_width

    @property
    def sentence(self) -> str:
        """How wide it is."""
        widest = int(np.argmax(self.half_width))
        usual = float(np.sqrt(np.mean(self.half_width**2)))
        within = quantity(usual, "rad/s", spec=".2g")
        at_most = quantity(float(self.half_width[widest]), "rad/s", spec=".2g")
        return (
            f"In 19 of 20 samples the machine's speed lies within ±{within} of this, "
            f"{percent(usual / self.reach)} of the range of its tests; at most ±{at_most}, at "
            f"{self.time[widest]:.3g} s."
        )

    def to_polars(self) -> polars.DataFrame:
        """A row a sample: time [s], speed, lower and upper end [rad/s]."""
        import polars as pl

        return pl.DataFrame(
            {
                "time": self.time,
                "shaft_speed": self.speed,
                "shaft_speed_lower": self.lower,
                "shaft_speed_upper": self.upper,
            }
        )


def speed_band(
    drive: Drive, run: Simulation, verdict: Verdict, posterior: Posterior
) -> Band | None:
    """The band about the speed of a run that a fitted drive simulates.

    Parameters
    ----------
    drive : Drive
        The fitted one.
    run : Simulation
        What it simulates.
    verdict : Verdict
        On the fit.
    posterior : Posterior
        What the fit leaves open of the drive's numbers.

    Returns
    -------
    Band or None
        None if no run of the fit measured the motion of the shaft.
    """
    stated = error_of_motion(verdict.predictions)
    if stated is None:
        return None
    speed, time = run.shaft_speed, run.time
    variance = np.zeros(speed.size)
    if posterior.names:
        by = drive_sensitivities(drive.parameters, run.records, run.start, posterior.names)
        variance = np.sum((by["shaft_speed"] @ posterior.changes) ** 2, axis=1)
    errors = stated.squares(speed, np.gradient(speed, time))
    return Band(time, speed, np.sqrt(DEVIATIONS**2 * variance + errors), stated.reach)


def error_of_motion(predictions: Iterable[PredictionError]) -> PredictionError | None:
    """What is stated of the channel that knows the motion of shaft or rod best."""
    of_shaft = [stated for stated in predictions if stated.unit in SPEEDS]
    return min(of_shaft, key=lambda stated: stated.worst.error, default=None)
