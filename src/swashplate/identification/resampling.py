"""Noise of the same colour as a fit's residuals: block bootstrap of their innovations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.identification.autocorrelation import (
    NoiseColour,
    colour_of,
    grid_of,
    pair_sums,
    unweighted,
)
from swashplate.identification.autoregression import Autoregression, autoregression
from swashplate.identification.coloured_noise import noise_model
from swashplate.identification.linearised import LinearisedFit

Array = NDArray[np.float64]

LONGEST_BLOCK = 0.25
"""Of a run's innovations: with longer blocks draws would hardly differ."""


FEWEST = 100
"""Innovations from which a run draws on its own alone."""


class Resampling:
    """Draws noise like a fit's, run by run.

    Parameters
    ----------
    fit : LinearisedFit
        The fit.
    seed : int
        Of the draws. Draw k is the same on any number of cores and in any order.
    block : float, optional
        Length of the blocks. [s] By default Politis and White's for each channel's innovations.

    Raises
    ------
    InputError
        If the block length is not positive, or there are no more samples than unknowns.

    Notes
    -----
    Residuals are whitened with an autoregression, moving blocks of these innovations are drawn
    within the run, and coloured again (post-blackened blocks, Davison and Hinkley 1997, section
    8.2). Blocks of the residuals themselves cut every slow swing in two: with residuals that are
    correlated over a fiftieth of a run their 95 % intervals covered 88 %. The autoregression is
    that of the noise, not of the residuals, which lack what the fit took (`coloured_noise`). Gaps
    are marched over and then left out, and weights are put back where noise lands.
    """

    def __init__(self, fit: LinearisedFit, *, seed: int = 0, block: float | None = None) -> None:
        if block is not None and not block > 0.0:
            raise InputError(f"A block of {block:g} s is none; give a positive length.")
        model = noise_model(fit)
        self.fit, self.seed = fit, seed
        self._runs: dict[int, _Run] = {}
        for colour in model.colours:
            samples = sum(fit.runs[m].time.size for m in colour.members)
            process = autoregression(colour, samples)
            innovations = {
                m: process.innovations(unweighted(fit.runs[m]), grid_of(fit.runs[m].time))
                for m in colour.members
            }
            common = np.concatenate(list(innovations.values()))
            length = _block_length(common, colour) if block is None else block / colour.step
            for m in colour.members:
                # a run too short for innovations of its own borrows the others'
                enough = innovations[m].size >= max(FEWEST, 4.0 * length)
                own = innovations[m] if enough else common
                size = float(np.sqrt(model.levels[m]))
                self._runs[m] = _Run(fit.runs[m].time, process, own, length, size)

    @property
    def blocks(self) -> tuple[float, ...]:
        """Length of the blocks of each run. [s]"""
        return tuple(
            self._runs[m].length * grid_of(run.time).step for m, run in enumerate(self.fit.runs)
        )

    def differences(self, draw: int) -> tuple[Array, ...]:
        """For each run (n,) differences simulated less measured that might have been as well.

        To refit, take as measured what the optimum simulates less these.
        """
        return tuple(
            self._runs[m].noise(
                np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(draw, m)))
            )
            for m in range(len(self.fit.runs))
        )

    def residuals(self, draw: int) -> tuple[Array, ...]:
        """The same, weighted."""
        return tuple(
            difference if run.weight is None else run.weight * difference
            for run, difference in zip(self.fit.runs, self.differences(draw), strict=True)
        )


class _Run:
    """One run: where its innovations come from and where its noise goes."""

    def __init__(
        self,
        time: Array,
        process: Autoregression,
        innovations: Array,
        length: float,
        size: float,
    ) -> None:
        self.process, self.size = process, size
        # one sample has no innovations to draw from: its sign alone can differ
        self.innovations = innovations if innovations.size else np.array([-1.0, 1.0])
        most = max(int(LONGEST_BLOCK * self.innovations.size), 1)
        self.length = int(np.clip(round(length), 1, most))
        grid = grid_of(time)
        self.places = grid.places
        self.count = grid.size + process.settling

    def noise(self, generator: np.random.Generator) -> Array:
        """(n,) one draw."""
        blocks = -(-self.count // self.length)
        starts = generator.integers(self.innovations.size - self.length + 1, size=blocks)
        picked = (starts[:, None] + np.arange(self.length)).ravel()[: self.count]
        return self.size * self.process.coloured(self.innovations[picked])[self.places]


def _block_length(innovations: Array, colour: NoiseColour) -> float:
    """Politis and White's length for innovations. [steps]"""
    if innovations.size < 8:
        return 1.0
    grid = grid_of(np.arange(innovations.size, dtype=np.float64))
    lags = min(innovations.size // 4, max(colour.longest, 1))
    sums, counts = pair_sums(innovations, grid, lags)
    left = colour_of(colour.channel, (0,), 1.0, sums, counts)
    return politis_white_length(left, innovations.size)


def politis_white_length(colour: NoiseColour, samples: int) -> float:
    """Length of moving blocks that estimates a mean's variance with the least squared error.

    Parameters
    ----------
    colour : NoiseColour
        Of what is drawn from.
    samples : int
        Over which it is spread.

    Returns
    -------
    float
        At least 1. [steps]

    Notes
    -----
    (2 (Σ |k| γ_k)² N / (4/3 g²))^(1/3), g = Σ γ_k (Politis and White 2004, with the correction of
    Patton, Politis and White 2009).
    """
    lags = np.arange(colour.correlation.size)
    slope = 2.0 * float(np.sum(lags * colour.correlation))
    return max(1.0, float(np.cbrt(1.5 * (slope / colour.inflation) ** 2 * samples)))
