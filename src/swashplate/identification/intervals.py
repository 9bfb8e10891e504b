"""Estimates with standard errors and intervals in their own units."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from swashplate.errors import InputError
from swashplate.identification.covariance import Covariance

Status = Literal["estimated", "at its lower bound", "at its upper bound", "undetermined"]


class Estimate(NamedTuple):
    """One unknown with what is known of its error."""

    name: str
    value: float
    status: Status
    standard_error: float | None
    """In the unknown's unit; of a logarithmic one the value times the logarithm's. None unless
    estimated."""
    lower: float | None
    """End of the interval; asymmetric about the value for a logarithmic unknown."""
    upper: float | None
    degrees_of_freedom: float | None


def estimates(covariance: Covariance, *, level: float = 0.95) -> tuple[Estimate, ...]:
    """Estimates with intervals from a covariance.

    Parameters
    ----------
    covariance : Covariance
        Of the solver's vector.
    level : float
        Probability of the intervals, between 0 and 1.

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
    if not 0.0 < level < 1.0:
        raise InputError(f"The level {level:g} of an interval must lie between 0 and 1.")
    from scipy.stats import t as student

    variables = covariance.variables
    errors = covariance.standard_errors
    quantiles = student.ppf(0.5 + 0.5 * level, covariance.degrees_of_freedom)
    reach = np.where(
        covariance.determined, quantiles * np.where(covariance.determined, errors, 0), 0
    )
    lower = variables.to_values(variables.vector - reach)
    upper = variables.to_values(variables.vector + reach)
    made = []
    for k, name in enumerate(variables.names):
        value = float(variables.values[k])
        if variables.at_bound[k]:
            low = variables.at_bound[k] < 0
            side: Status = "at its lower bound" if low else "at its upper bound"
            made.append(Estimate(name, value, side, None, None, None, None))
        elif not covariance.determined[k]:
            made.append(Estimate(name, value, "undetermined", None, None, None, None))
        else:
            error = float(abs(variables.slopes[k]) * errors[k])
            freedom = float(covariance.degrees_of_freedom[k])
            ends = float(lower[k]), float(upper[k])
            made.append(Estimate(name, value, "estimated", error, *ends, freedom))
    return tuple(made)
