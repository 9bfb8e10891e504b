"""What an earlier stage does not know, carried into the one after it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.identification.covariance import Covariance
from swashplate.identification.drive_model import DriveModel
from swashplate.identification.linearised import LinearisedFit

if TYPE_CHECKING:
    from swashplate.identification.fit import StageFit

Array = NDArray[np.float64]


class Handed(NamedTuple):
    """An earlier stage's estimates as the later one takes them for granted."""

    covariance: Covariance
    """Of the earlier stage's vector."""
    slopes: Array
    """(K, K_earlier) by how much the later stage's vector follows the earlier one's."""

    @property
    def added(self) -> Array:
        """(K, K) covariance that it adds to the later stage's own."""
        added: Array = self.slopes @ self.covariance.matrix @ self.slopes.T
        return added


def slopes_by_earlier(
    stage: StageFit, earlier: StageFit, linearised: LinearisedFit
) -> Array | None:
    """Derivatives of a stage's estimates by those of an earlier one.

    Parameters
    ----------
    stage : StageFit
        Pump and motor, driven by the current that the card makes.
    earlier : StageFit
        The card.
    linearised : LinearisedFit
        Of the later stage at its optimum.

    Returns
    -------
    (K, K_earlier) array or None
        None where the later stage takes nothing from the earlier one: its current is measured, or
        it frees the same part itself.

    Notes
    -----
    The later estimate makes J₂ᵀ r₂ = 0, so to first order dθ₂/dθ₁ = -(J₂ᵀJ₂)⁻¹ J₂ᵀ ∂r₂/∂θ₁: the
    second step of a two-step estimate (Murphy and Topel 1985). Gauss-Newton's approximation, as
    everywhere here: second derivatives times residuals are left out.
    """
    model = stage.problem.model
    if not isinstance(model, DriveModel) or model.part != "pump" or earlier.stage.part != "card":
        return None
    simulated = [
        number
        for number, each in enumerate(stage.problem.experiments)
        if stage.stage.current == "simulated" and each.input.kind == "voltage"
    ]
    if not simulated:
        return None
    chain = DriveModel(stage.parameters, "chain")
    unknowns, vector = earlier.problem.unknowns, earlier.solution.vector
    names = [name for each in unknowns if each.run is None for name in each.targets]
    products = np.zeros((linearised.rank, len(unknowns)))
    rows = {(run.name, run.channel): run for run in linearised.runs}
    values = dict(stage.problem.unknowns.targets(stage.solution.vector, ""))
    for number in simulated:
        experiment = stage.problem.experiments[number]
        own = stage.problem.unknowns.targets(stage.solution.vector, experiment.name)
        by_card = chain.linearise(
            {name: value for name, value in own.items() if name not in values}, experiment, names
        )
        by_vector = unknowns.chain(vector, names, "")
        for name, weight in stage.problem.weights[number].items():
            used = weight > 0.0
            if not used.any():
                continue
            run = rows[experiment.name, name]
            moved = weight[used, None] * (by_card[name].by[used] @ by_vector)
            products += (run.jacobian @ linearised.whitening).T @ moved
    slopes: Array = -linearised.whitening @ products
    return slopes


def with_handed(own: Covariance, handed: Sequence[Handed]) -> Covariance:
    """A stage's covariance with what earlier stages do not know.

    The degrees of freedom are Satterthwaite's, of the sum of the variances.
    """
    if not handed:
        return own
    total = own.matrix.copy()
    variance = np.diag(own.matrix).copy()
    spread = _part(variance, own.degrees_of_freedom)
    for each in handed:
        added = np.where(np.outer(own.determined, own.determined), each.added, 0.0)
        total += added
        # of each earlier unknown by itself, as if they were independent of each other
        parts = each.slopes**2 * np.diag(each.covariance.matrix)
        share = parts / np.maximum(parts.sum(axis=1, keepdims=True), 1e-300)
        freedom = 1.0 / np.maximum(
            np.sum(share**2 / each.covariance.degrees_of_freedom, axis=1), 1e-300
        )
        spread += _part(np.diag(added), freedom)
    variance = np.diag(total)
    freedom = np.divide(variance**2, spread, out=np.full_like(variance, np.inf), where=spread > 0.0)
    return replace(own, matrix=total, degrees_of_freedom=freedom)


def _part(variance: Array, freedom: Array) -> Array:
    part: Array = variance**2 / freedom
    return part
