"""Errors of a fit's estimates: for coloured residuals, and for white ones beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swashplate.identification.autocorrelation import NoiseColour, noise_colours
from swashplate.identification.checked_ends import CheckedEnd
from swashplate.identification.coloured_noise import coloured_noise_covariance
from swashplate.identification.covariance import Covariance, white_noise_covariance
from swashplate.identification.handed_on import Handed, with_handed
from swashplate.identification.intervals import Estimate, estimates, reach
from swashplate.identification.linearised import LinearisedFit
from swashplate.identification.named_tones import tone_sentences
from swashplate.identification.swelling_noise import swelling_noise_covariance
from swashplate.identification.tones import Tone, separated

Array = NDArray[np.float64]

NOTABLE = 1.2
"""Ratio of the errors under noise that differs along the runs to those under stationary noise from
which it is said that they differ."""


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Errors of a fit's estimates: those to quote, and others beside them."""

    quoted: Covariance
    """That of the stage's own noise with what earlier stages handed on."""
    own: Covariance
    """The larger one, unknown by unknown, of the next two."""
    coloured: Covariance
    """Stationary coloured noise."""
    swelling: Covariance
    """Noise that differs along the runs."""
    white: Covariance
    """Too small where residuals are coloured; to stand beside the others."""
    colours: tuple[NoiseColour, ...]
    samples: tuple[tuple[str, int, float], ...]
    """For each run its label, samples, and the independent samples that they are worth."""
    uneven: tuple[str, ...]
    """Unknowns whose error is notably larger because the noise is not alike everywhere."""
    noisy: bool
    """Whether there are any residuals at all."""
    level: float
    handed: tuple[Handed, ...] = ()
    """What earlier stages do not know."""
    tones: tuple[Tone, ...] = ()
    """Lines in the residuals' spectra, taken out before the noise was judged."""
    ends: tuple[CheckedEnd, ...] = ()
    """Sides on which the cost does not rise as the covariance says."""
    priors: tuple[str, ...] = ()
    """What each prior adds, in words."""

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Values with the quoted intervals; ends that were checked stand in place of others."""
        more = reach(self.quoted, self.level) ** 2 - reach(self.own, self.level) ** 2
        ends = {
            (end.number, end.upper): float(np.sqrt(end.distance**2 + max(more[end.number], 0.0)))
            for end in self.ends
        }
        return estimates(self.quoted, level=self.level, ends=ends)

    @property
    def inflation(self) -> Array:
        """(K,) samples that stand for one independent one, at least 1, unknown by unknown.

        The ratio of the stage's own variance to that of white noise; for profiles.
        """
        white = np.diag(self.white.matrix)
        known = self.own.determined & (white > 0.0)
        ratio = np.divide(np.diag(self.own.matrix), white, out=np.ones_like(white), where=known)
        return np.maximum(ratio, 1.0)

    def sentences(self) -> tuple[str, ...]:
        """What the errors rest on."""
        if not self.noisy:
            return ("The residuals are exactly zero: errors of zero say nothing of other tests.",)
        said = list(tone_sentences(self.tones))
        for colour in self.colours:
            if colour.length:
                worth = (
                    f"{colour.inflation:.3g} samples are worth one"
                    if colour.inflation > 1.05
                    else "positive and negative correlations cancel, and the samples tell as much "
                    "as independent ones"
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
                f"White-noise errors would be {ratio:.2g} times too small; the report shows them "
                "for comparison only."
            )
        if self.uneven:
            said.append(
                f"The noise is not alike in all parts of the runs: {', '.join(self.uneven)} "
                f"{'has' if len(self.uneven) == 1 else 'have'} wider intervals for it."
            )
        said += self.priors
        for end in self.ends:
            side, name = "upper" if end.upper else "lower", self.own.variables.names[end.number]
            if end.better is not None:
                said.append(
                    f"Moving {name} met a better optimum, cost {end.better:.6g}: start from more "
                    "points."
                )
            elif not np.isfinite(end.distance):
                said.append(
                    f"{name} has no {side} end: the cost does not rise enough on that side."
                )
            else:
                said.append(f"The {side} end of {name} is that of its profile, which is lopsided.")
        widened = self._widened()
        if widened is not None:
            said.append(widened)
        return tuple(said)

    def _widened(self) -> str | None:
        """What the uncertainty of earlier stages does."""
        known = self.own.determined & (np.diag(self.own.matrix) > 0.0)
        if not self.handed or not known.any():
            return None
        ratio = np.where(known, self.quoted.standard_errors, 1.0) / np.where(
            known, self.own.standard_errors, 1.0
        )
        most = int(np.argmax(ratio))
        return (
            "Intervals take in what the stages before do not know: it widens them by a factor of "
            f"{float(np.median(ratio[known])):.2f} in the middle and of {ratio[most]:.2f} for "
            f"{self.own.variables.names[most]}."
        )

    def _ratio(self) -> float | None:
        """Median of the stage's own over white error."""
        known = self.own.determined & (self.white.standard_errors > 0.0)
        if not known.any():
            return None
        ratio = self.own.standard_errors[known] / self.white.standard_errors[known]
        median = float(np.median(ratio))
        return median if median > 1.05 else None


def uncertainty(
    fit: LinearisedFit, *, level: float = 0.95, handed: Sequence[Handed] = ()
) -> Uncertainty:
    """Errors of a fit's estimates for coloured residuals, with white-noise ones beside them.

    Parameters
    ----------
    fit : LinearisedFit
        The fit at its optimum.
    level : float
        Probability of the intervals.
    handed : sequence of Handed, optional
        What earlier stages do not know.

    Raises
    ------
    InputError
        If there are no more samples than unknowns, or the level is not between 0 and 1.
    """
    clean = separated(fit)
    colours = noise_colours(clean.fit)
    coloured = _with(coloured_noise_covariance(clean.fit, colours=colours), clean.covariance)
    swelling = swelling_noise_covariance(fit)
    own, uneven = _wider(coloured, swelling)
    worth = {m: colour for colour in colours for m in colour.members}
    made = Uncertainty(
        with_handed(own, handed),
        own,
        coloured,
        swelling,
        white_noise_covariance(fit),
        colours,
        tuple(
            (run.label, run.time.size, worth[m].effective_samples(run.time.size))
            for m, run in enumerate(fit.runs)
        ),
        uneven,
        fit.squares > 0.0,
        level,
        tuple(handed),
        clean.tones,
    )
    made.estimates  # noqa: B018  refuses a wrong level
    return made


def _with(covariance: Covariance, added: Array) -> Covariance:
    known = np.outer(covariance.determined, covariance.determined)
    return replace(covariance, matrix=covariance.matrix + np.where(known, added, 0.0))


def _wider(coloured: Covariance, swelling: Covariance) -> tuple[Covariance, tuple[str, ...]]:
    """The larger of two errors, unknown by unknown, and where the second is notably larger."""
    narrow = np.where(coloured.determined, coloured.standard_errors, 1.0)
    ratio = np.where(coloured.determined, swelling.standard_errors, 0.0) / np.where(
        narrow > 0.0, narrow, 1.0
    )
    stretch = np.maximum(ratio, 1.0)
    quoted = Covariance(
        "coloured",
        coloured.variables,
        coloured.matrix * np.outer(stretch, stretch),
        coloured.determined,
        np.where(ratio > 1.0, swelling.degrees_of_freedom, coloured.degrees_of_freedom),
    )
    names = np.array(coloured.variables.names)
    return quoted, tuple(names[ratio > NOTABLE])
