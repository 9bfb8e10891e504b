"""Errors of a fit's estimates: for coloured residuals, and for white ones beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swashplate.identification.autocorrelation import NoiseColour, noise_colours
from swashplate.identification.coloured_noise import coloured_noise_covariance
from swashplate.identification.covariance import (
    Covariance,
    hac_covariance,
    white_noise_covariance,
)
from swashplate.identification.intervals import Estimate, estimates
from swashplate.identification.linearised import LinearisedFit

Array = NDArray[np.float64]

DEVIATIONS = 5.0
"""By how many of its own standard deviations a HAC error must be larger to count as such. It is
taken from squares of coloured residuals, of which three are exceeded in one campaign of eight."""

TRUSTED = 10.0
"""Independent stretches from which a HAC variance is held against the other one."""


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Errors of a fit's estimates: those to quote, and others beside them."""

    quoted: Covariance
    """Stationary coloured noise, or HAC for unknowns where that is significantly larger."""
    coloured: Covariance
    hac: Covariance
    white: Covariance
    """Too small where residuals are coloured; to stand beside the others."""
    colours: tuple[NoiseColour, ...]
    samples: tuple[tuple[str, int, float], ...]
    """For each run its label, samples, and the independent samples that they are worth."""
    uneven: tuple[str, ...]
    """Unknowns whose HAC error is significantly larger: the noise is not alike everywhere."""
    noisy: bool
    """Whether there are any residuals at all."""
    level: float

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Values with the quoted intervals."""
        return estimates(self.quoted, level=self.level)

    @property
    def inflation(self) -> Array:
        """(K,) samples that stand for one independent one, at least 1, unknown by unknown.

        The ratio of the quoted variance to that of white noise; for profiles.
        """
        white = np.diag(self.white.matrix)
        known = self.quoted.determined & (white > 0.0)
        ratio = np.divide(np.diag(self.quoted.matrix), white, out=np.ones_like(white), where=known)
        return np.maximum(ratio, 1.0)

    def sentences(self) -> tuple[str, ...]:
        """What the errors rest on."""
        if not self.noisy:
            return ("The residuals are exactly zero: errors of zero say nothing of other tests.",)
        said = []
        for colour in self.colours:
            if colour.length:
                worth = (
                    f"{colour.inflation:.3g} samples are worth one"
                    if colour.inflation > 1.05
                    else "they swing to and fro, so that each sample still counts as one"
                )
                said.append(
                    f"Residuals of {colour.channel} stay correlated over {colour.duration:.3g} s: "
                    f"{worth}."
                )
            else:
                said.append(f"Residuals of {colour.channel} are white.")
            if colour.drifting:
                said.append(
                    f"That is a large part of a run: those of {colour.channel} are a model error "
                    "or a tone rather than noise, and intervals cover noise alone."
                )
        ratio = self._ratio()
        if ratio is not None:
            said.append(
                f"White-noise errors would be {ratio:.2g} times too small; they are shown for "
                "comparison only."
            )
        if self.uneven:
            said.append(
                f"The noise is not alike in all parts of the runs: for {', '.join(self.uneven)} "
                "the wider HAC interval is quoted."
            )
        return tuple(said)

    def _ratio(self) -> float | None:
        """Median of quoted over white error."""
        known = self.quoted.determined & (self.white.standard_errors > 0.0)
        if not known.any():
            return None
        ratio = self.quoted.standard_errors[known] / self.white.standard_errors[known]
        median = float(np.median(ratio))
        return median if median > 1.05 else None


def uncertainty(fit: LinearisedFit, *, level: float = 0.95) -> Uncertainty:
    """Errors of a fit's estimates for coloured residuals, with white-noise ones beside them.

    Parameters
    ----------
    fit : LinearisedFit
        The fit at its optimum.
    level : float
        Probability of the intervals.

    Raises
    ------
    InputError
        If there are no more samples than unknowns, or the level is not between 0 and 1.
    """
    colours = noise_colours(fit)
    coloured = coloured_noise_covariance(fit, colours=colours)
    hac = hac_covariance(fit)
    quoted, uneven = _wider(coloured, hac)
    worth = {m: colour for colour in colours for m in colour.members}
    made = Uncertainty(
        quoted,
        coloured,
        hac,
        white_noise_covariance(fit),
        colours,
        tuple(
            (run.label, run.time.size, worth[m].effective_samples(run.time.size))
            for m, run in enumerate(fit.runs)
        ),
        uneven,
        fit.squares > 0.0,
        level,
    )
    made.estimates  # noqa: B018  refuses a wrong level
    return made


def _wider(coloured: Covariance, hac: Covariance) -> tuple[Covariance, tuple[str, ...]]:
    """Where HAC errors are larger by more than five of their own standard deviations, those."""
    freedom = hac.degrees_of_freedom
    narrow = np.where(coloured.determined, coloured.standard_errors, 1.0)
    ratio = np.where(coloured.determined, hac.standard_errors, 0.0) / np.where(
        narrow > 0.0, narrow, 1.0
    )
    # the relative standard deviation of an error with ν degrees of freedom is 1/√(2ν)
    larger = (freedom >= TRUSTED) & (ratio > 1.0 + DEVIATIONS / np.sqrt(2.0 * freedom))
    if not larger.any():
        return coloured, ()
    stretch = np.where(larger, ratio, 1.0)
    quoted = Covariance(
        "coloured",
        coloured.variables,
        coloured.matrix * np.outer(stretch, stretch),
        coloured.determined,
        np.where(larger, freedom, coloured.degrees_of_freedom),
    )
    names: Sequence[str] = coloured.variables.names
    return quoted, tuple(name for name, more in zip(names, larger, strict=True) if more)
