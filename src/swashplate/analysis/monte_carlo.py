"""Monte Carlo over a fit's uncertainty: drives drawn from the covariance of its estimates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.draws import Draws, filled
from swashplate.errors import DomainError, InputError
from swashplate.identification.assessment import Assessment
from swashplate.identification.drive_model import DriveModel
from swashplate.parameters.parameter_set import ParameterSet

Array = NDArray[np.float64]


class Deviations(NamedTuple):
    """Errors of one stage's vector."""

    own: Array
    """(K, K) covariance of its own noise."""
    slopes: Mapping[int, Array] = MappingProxyType({})
    """By the number of an earlier stage (K, K_earlier): by how much its errors move this one's."""


def draw_deviations(stages: Sequence[Deviations], random: np.random.Generator) -> tuple[Array, ...]:
    """Errors of all stages' vectors, drawn together.

    Parameters
    ----------
    stages : sequence of Deviations
        In the order of the fit.
    random : Generator
        Source of the numbers.

    Returns
    -------
    tuple of (K,) arrays
        For each stage.

    Notes
    -----
    δ₁ = ε₁ and δ₂ = S δ₁ + ε₂ with independent normal ε: then cov(δ₂) = S cov(δ₁) Sᵀ + own, which
    is the quoted covariance, and cov(δ₂, δ₁) = S cov(δ₁).
    """
    drawn: list[Array] = []
    for each in stages:
        values, directions = np.linalg.eigh(each.own)
        error = directions @ (np.sqrt(np.maximum(values, 0.0)) * random.normal(size=values.size))
        for earlier, slopes in each.slopes.items():
            error = error + slopes @ drawn[earlier]
        drawn.append(error)
    return tuple(drawn)


def drives(assessments: Sequence[Assessment], draws: int = 200, seed: int = 0) -> Draws:
    """Drives that a fit's tests allow, drawn from the errors of its estimates.

    Parameters
    ----------
    assessments : sequence of Assessment
        Of all stages of the fit, see `identification.assessment.assess`.
    draws : int
        How many, at least 1.
    seed : int
        The same seed gives the same drives.

    Raises
    ------
    InputError
        If there is no assessment or no draw, or nearly all draws leave the model's domain.

    Notes
    -----
    Errors are normal in the solver's vector, so that a logarithmic unknown is log-normal. What the
    card's stage does not know moves pump and motor as the fit would follow it, see
    `identification.uncertainty`.
    """
    if not assessments:
        raise InputError("A Monte Carlo needs the assessment of at least one stage.")
    stages = [_deviations(assessments, number) for number in range(len(assessments))]
    random = np.random.default_rng(seed)

    def once() -> ParameterSet | None:
        parameters: ParameterSet | None = None
        for each, error in zip(assessments, draw_deviations(stages, random), strict=True):
            problem, model = each.stage.problem, each.stage.problem.model
            assert isinstance(model, DriveModel)
            vector = each.stage.solution.vector + error
            low, high = problem.unknowns.bounds
            free = each.uncertainty.own.determined
            if ((vector < low) | (vector > high))[free].any():
                return None
            begin = model.parameters if parameters is None else parameters
            try:
                # a model of its own: the fitted one keeps what it made for other parameters
                parameters = DriveModel(begin, model.part, forces=model.forces).parameters_at(
                    problem.unknowns.targets(vector, "")
                )
            except DomainError:
                return None
        return parameters

    held = tuple(
        name
        for each in assessments
        for name, unknown, known in zip(
            each.stage.problem.unknowns.names,
            each.stage.problem.unknowns,
            each.uncertainty.own.determined,
            strict=True,
        )
        if not known and unknown.run is None
    )
    return filled(once, draws, held, True)


def _deviations(assessments: Sequence[Assessment], number: int) -> Deviations:
    found = assessments[number].uncertainty
    slopes = {
        earlier: each.slopes
        for each in found.handed
        for earlier in range(number)
        if assessments[earlier].uncertainty.quoted is each.covariance
    }
    return Deviations(found.own.matrix, slopes)
