"""The truth of virtual tests in the scales that a fit held, to stand beside its estimates."""

from __future__ import annotations

from collections.abc import Mapping
from math import isclose

from swashplate.identification.drive_model import DriveModel
from swashplate.identification.fitting import Fit, StageFit
from swashplate.identification.identifiability import GAUGES, Gauge
from swashplate.identification.staging import true_value
from swashplate.parameters.definitions import COLUMNS
from swashplate.parameters.parameter_set import ParameterSet

SCALES = (
    "scale of pressure",
    "zero of pressure",
    "scale of spool travel",
    "scale of force",
    "piston motion against flow gain",
)
"""Gauges along which nothing that is measured changes (the last one, away from the stops), in an
order in which none undoes an earlier one."""
NEARLY = ("scale of the spool's tilt", "scale of the swash angle")
"""Those along which hardly anything changes: a fit that holds one of their parameters follows."""


def true_values(stage: StageFit, truth: ParameterSet) -> dict[str, float]:
    """What the stage's unknowns of the machine really are, by name, in their units."""
    model = stage.problem.model
    assert isinstance(model, DriveModel)
    found = {}
    for name, unknown in zip(stage.problem.unknowns.names, stage.problem.unknowns, strict=True):
        value = true_value(unknown, model, truth)
        if value is not None:
            found[name] = value
    return found


def in_the_fits_scales(truth: ParameterSet, fit: Fit) -> ParameterSet:
    """The same machine with what the fit held for scales as the fit has it.

    No test of speed tells pressures, spool travel and forces but up to a factor, so that a fit
    holds one parameter for each. A truth with other values of these is moved along the model's
    freedoms until they agree; what a speed can tell of it stays as it is.
    """
    free = moved_columns(fit)
    numbers = dict(truth.numbers)
    target = fit.parameters.numbers
    gauges = {each.name: each for each in GAUGES}
    for name in (*SCALES, *NEARLY):
        held = _held(gauges[name], free, target)
        if held is None or isclose(numbers[held], target[held], rel_tol=1e-12):
            continue
        amount = _amount(gauges[name], held, numbers, target[held])
        if amount is None:
            continue
        known = dict(numbers)
        for column, symbol in COLUMNS.items():
            move = gauges[name].moves.get(symbol)
            if move is not None:
                numbers[column] = move(known[column], amount, known)
    changes = {key: value for key, value in numbers.items() if value != truth.numbers[key]}
    return truth.replace(changes)


def _held(gauge: Gauge, free: set[str], target: Mapping[str, float]) -> str | None:
    """The parameter by which a fit fixes a gauge, None if there is none or no single one."""
    if gauge.name in NEARLY:
        found = [each for each in gauge.moves if each not in free and target.get(each, 0.0) != 0.0]
        return found[0] if len(found) == 1 else None
    return next((each for each in gauge.fix if each in target and each not in free), None)


def moved_columns(fit: Fit) -> set[str]:
    """Columns of the drive's parameters that some stage moved."""
    moved: set[str] = set()
    for each in fit.stages:
        for unknown in each.problem.unknowns:
            moved |= set(unknown.targets)
        if isinstance(each.problem.model, DriveModel) and each.problem.model.forces is not None:
            moved |= set(each.problem.model.forces.columns)
    return moved


def _amount(gauge: Gauge, held: str, numbers: dict[str, float], wanted: float) -> float | None:
    """How far along a gauge a parameter takes a value; None if it never does."""
    from scipy.optimize import brentq

    move = gauge.moves[held]

    def miss(amount: float) -> float:
        return move(numbers[held], amount, numbers) - wanted

    low, high = -10.0, 10.0
    if miss(low) * miss(high) > 0.0:
        return None
    return float(brentq(miss, low, high, xtol=1e-14, rtol=1e-14))
