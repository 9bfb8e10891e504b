"""Estimates with standard errors and intervals in their own units."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from types import MappingProxyType
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.identification.covariance import Covariance

Array = NDArray[np.float64]
Status = Literal[
    "estimated",
    "at its lower bound",
    "at its upper bound",
    "undetermined",
    "no lower end",
    "no upper end",
]


class Estimate(NamedTuple):
    """One unknown with what is known of its error."""

    name: str
    value: float
    status: Status
    standard_error: float | None
    """In the unknown's unit; of a logarithmic one the value times the logarithm's. None unless
    estimated."""
    lower: float | None
    """End of the interval; asymmetric about the value for a logarithmic unknown. None where there
    is no end."""
    upper: float | None
    degrees_of_freedom: float | None

    @property
    def relative_half_width(self) -> float:
        """Half of the interval over the value's size; infinite where an end is missing."""
        if self.lower is None or self.upper is None or self.value == 0.0:
            return inf
        return 0.5 * (self.upper - self.lower) / abs(self.value)


def reach(covariance: Covariance, level: float = 0.95) -> Array:
    """(K,) half widths of the intervals in the solver's vector; 0 for unknowns without one.

    Raises
    ------
    InputError
        If the level is not between 0 and 1.
    """
    if not 0.0 < level < 1.0:
        raise InputError(f"The level {level:g} of an interval must lie between 0 and 1.")
    from scipy.stats import t as student

    quantiles = student.ppf(0.5 + 0.5 * level, covariance.degrees_of_freedom)
    errors = np.where(covariance.determined, covariance.standard_errors, 0.0)
    half: Array = np.where(covariance.determined, quantiles * errors, 0.0)
    return half


def estimates(
    covariance: Covariance,
    *,
    level: float = 0.95,
    ends: Mapping[tuple[int, bool], float] = MappingProxyType({}),
) -> tuple[Estimate, ...]:
    """Estimates with intervals from a covariance.

    Parameters
    ----------
    covariance : Covariance
        Of the solver's vector.
    level : float
        Probability of the intervals, between 0 and 1.
    ends : mapping, optional
        By unknown's number and side, True for the upper, distances of ends that differ from the
        covariance's, in the solver's vector; inf where there is none.

    Raises
    ------
    InputError
        If the level is not between 0 and 1.

    Notes
    -----
    An interval is symmetric in the solver's vector, ± Student's quantile times the standard error,
    and carried over from there: a positive unknown never has a negative end. Student's rather than
    the normal quantile, because the variance is itself estimated, from a number of independent
    stretches of residual that may be small.
    """
    half = reach(covariance, level)
    variables = covariance.variables
    errors = covariance.standard_errors
    distances = {
        upper: np.array([ends.get((k, upper), half[k]) for k in range(half.size)])
        for upper in (False, True)
    }
    open_ended = {upper: np.isinf(distances[upper]) for upper in distances}
    with np.errstate(invalid="ignore"):
        lower = variables.to_values(variables.vector - distances[False])
        upper = variables.to_values(variables.vector + distances[True])
    made = []
    for k, name in enumerate(variables.names):
        value = float(variables.estimates[k])
        below, above = bool(open_ended[False][k]), bool(open_ended[True][k])
        if variables.at_bound[k]:
            low = variables.at_bound[k] < 0
            side: Status = "at its lower bound" if low else "at its upper bound"
            made.append(Estimate(name, value, side, None, None, None, None))
        elif not covariance.determined[k] or (below and above):
            made.append(Estimate(name, value, "undetermined", None, None, None, None))
        else:
            freedom = float(covariance.degrees_of_freedom[k])
            error = float(abs(variables.slopes[k]) * errors[k])
            status: Status = "estimated"
            if below or above:
                status = "no lower end" if below else "no upper end"
            made.append(
                Estimate(
                    name,
                    value,
                    status,
                    error if status == "estimated" else None,
                    None if below else float(lower[k]),
                    None if above else float(upper[k]),
                    freedom,
                )
            )
    return tuple(made)
