"""Numbers of independent seaways with their 95 % confidence intervals."""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.tables import count

Array = NDArray[np.float64]

ENOUGH = (10, 20, 30, 50, 75, 100, 150, 200, 300, 500, 700, 1000, 1500, 2000, 3000, 5000, 10_000)
"""Numbers of seaways that are advised if fewer do not decide."""


class ConfidenceInterval(NamedTuple):
    """A number with its 95 % confidence interval."""

    value: float
    low: float
    high: float


def mean_of(values: Array, least: float = -inf) -> ConfidenceInterval:
    """Mean of independent values with Student's interval; NaN are left out.

    The interval is cut off at `least`, below which the values cannot be.

    Notes
    -----
    Seaways are drawn independently, so that differences within each are, too. Near the limit of a
    drive they are skewed: with few seaways Student's interval is too narrow on the long side, but
    a bootstrap of few values is narrower still; with 200 both agree.
    """
    from scipy.special import stdtrit

    finite = values[np.isfinite(values)]
    mean = float(finite.mean()) if finite.size else np.nan
    if finite.size < 2:
        return ConfidenceInterval(mean, np.nan, np.nan)
    t = float(stdtrit(finite.size - 1, 0.975))
    half = t * float(finite.std(ddof=1)) / sqrt(finite.size)
    return ConfidenceInterval(mean, max(mean - half, least), mean + half)


def rms_of(values: Array) -> ConfidenceInterval:
    """Root mean square over independent seaways of a root mean square in each; NaN are left out.

    Its square is what a spectrum gives: the mean of the roots is smaller. The interval is the root
    of Student's for the mean of the squares.
    """
    squares = mean_of(values**2, 0.0)
    rms, low, high = np.sqrt(np.array(squares)).tolist()
    return ConfidenceInterval(rms, low, high)


def share_of(hits: int, of: int, unknown: int = 0) -> ConfidenceInterval:
    """Share of independent seaways with its exact interval (Clopper and Pearson 1934).

    Parameters
    ----------
    hits, of : int
        Seaways of a kind, and all of them.
    unknown : int
        Seaways among `of`, and not among `hits`, of which the kind is not known: the interval
        holds whatever they are.
    """
    from scipy.special import betaincinv

    most = hits + unknown
    low = float(betaincinv(hits, of - hits + 1, 0.025)) if hits > 0 else 0.0
    high = float(betaincinv(most + 1, of - most, 0.975)) if most < of else 1.0
    return ConfidenceInterval(hits / of, low, high)


def share_in_seaways(share: ConfidenceInterval, seaways: int) -> str:
    """A share of seaways in words: ``"2 of 37 seaways (95 % interval 0.7 to 18.2 %)"``."""
    low, high = 100.0 * share.low, 100.0 * share.high
    of = f"{round(share.value * seaways)} of {count(seaways, 'seaway')}"
    return f"{of} (95 % interval {low:.1f} to {high:.1f} %)"


def more_seaways(share: float, seaways: int, allowed: float) -> str:
    """Larger number of seaways that distinguishes a share from the allowed one, if it stays."""
    for number in ENOUGH:
        interval = share_of(round(share * number), number)
        if number > seaways and not interval.low <= allowed <= interval.high:
            return f"about {number}"
    # a share as large as the one allowed: more seaways will first tell whether it stays so
    return f"{10 * seaways} to begin with"


def fewest_seaways(allowed: float) -> int:
    """Least number of seaways with which a share of 0 is below the one allowed, with 95 %."""
    from math import ceil, log

    return ceil(log(0.025) / log(1.0 - allowed)) if allowed > 0.0 else 0
