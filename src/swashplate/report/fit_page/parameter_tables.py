"""Tables of a fit's parameters: what was found, how sure it is, what was held."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from swashplate.errors import InputError
from swashplate.identification.assessment import Assessment
from swashplate.identification.drive_model import DriveModel
from swashplate.identification.fitting import Fit, StageFit
from swashplate.identification.identifiability import GAUGES
from swashplate.identification.own_model import ModelParameters
from swashplate.identification.uncertainty import Estimate, estimates
from swashplate.identification.unknowns import Unknown
from swashplate.parameters.definitions import CATALOGUE, COLUMNS
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.report.fit_page.numbers import NONE, percent, plain, spread, unit_text
from swashplate.report.fit_page.truth import SCALES, moved_columns, true_values
from swashplate.simulation.instance import START_PRESSURE


class ParameterRow(NamedTuple):
    """One unknown, as text."""

    name: str
    meaning: str
    unit: str
    nominal: str
    estimate: str
    change: str
    """Of the nominal value."""
    interval: str
    """For coloured noise; empty where none may be given."""
    half_width: str
    """Of that interval, of the value."""
    white: str
    """The interval for white noise."""
    status: str
    truth: str = ""
    """Where it is known, in the scales that the fit held."""
    holds: str = ""
    """Whether the interval holds the truth."""


class ParameterTable(NamedTuple):
    """The unknowns of one stage."""

    stage: str
    level: str
    """Of the intervals, as ``"95 %"``."""
    white: str
    """Heading of the white-noise intervals: what they are good for."""
    rows: tuple[ParameterRow, ...]
    """Of all runs together."""
    own: tuple[ParameterRow, ...]
    """Of single runs."""


class HeldRow(NamedTuple):
    """A parameter that was not fitted."""

    name: str
    meaning: str
    unit: str
    value: str
    why: str
    """As far as it is known."""
    source: str
    truth: str = ""
    """Where it is known."""


def parameter_table(assessment: Assessment, truth: ParameterSet | None = None) -> ParameterTable:
    """Table of a stage's unknowns.

    Parameters
    ----------
    assessment : Assessment
        Of the stage.
    truth : ParameterSet, optional
        Of virtual tests, in the scales that the fit held (`truth.in_the_fits_scales`).
    """
    stage = assessment.stage
    true = {} if truth is None else true_values(stage, truth)
    level = 0.95
    quoted: Sequence[Estimate | None]
    white: Sequence[Estimate | None]
    try:
        found = assessment.uncertainty
        level, quoted = found.level, found.estimates
        white = estimates(found.white, level=level)
    except InputError:
        # the verdict says why there are no intervals
        quoted = white = [None] * len(stage.problem.unknowns)
    values = stage.values
    point = stage.problem.unknowns.at(stage.solution.vector)
    sides = {-1: "lower", 1: "upper"}
    ends = zip(point.names, point.at_bound, strict=True)
    at_bounds = {name: sides.get(int(k)) for name, k in ends}
    rows, own = list[ParameterRow](), list[ParameterRow]()
    for name, unknown, estimate, narrow in zip(
        stage.problem.unknowns.names, stage.problem.unknowns, quoted, white, strict=True
    ):
        row = _row(stage, name, unknown, values[name], estimate, narrow, at_bounds.get(name))
        if name in true:
            row = row._replace(truth=plain(true[name]), holds=_holds(estimate, true[name]))
        (rows if unknown.run is None else own).append(row)
    return ParameterTable(
        stage.stage.name,
        f"{100.0 * level:g} %",
        _white_words(quoted, white),
        tuple(rows),
        tuple(own),
    )


def held_rows(fit: Fit, truth: ParameterSet | None = None) -> tuple[HeldRow, ...]:
    """The parameters that no stage moved.

    Parameters
    ----------
    fit : Fit
        What was fitted.
    truth : ParameterSet, optional
        As it is, in no other scales.
    """
    moved, parameters = moved_columns(fit), fit.parameters
    if isinstance(parameters, ModelParameters):
        return tuple(
            HeldRow(name, "", "", plain(value), "given with the model", "")
            for name, value in parameters.numbers.items()
            if name not in moved
        )
    rows = []
    for column, symbol in COLUMNS.items():
        if column in moved:
            continue
        parameter = parameters[symbol]
        rows.append(
            HeldRow(
                column,
                meaning_of(column),
                unit_text(parameter.unit),
                plain(parameters.numbers[column]),
                _why_held(parameters, column, symbol, moved),
                parameter.source,
                "" if truth is None else plain(truth.numbers[column]),
            )
        )
    return tuple(rows)


def _why_held(parameters: ParameterSet, column: str, symbol: str, moved: set[str]) -> str:
    """Why nothing was to be found out about a parameter, as far as that can be told."""
    for gauge in GAUGES:
        held = next((each for each in gauge.fix if not _is_moved(each, moved)), None)
        others = [each for each in gauge.moves if each != symbol and _is_moved(each, moved)]
        if gauge.name in SCALES and held == symbol and others:
            return f"fixes the {gauge.name}: {gauge.determined}"
    if parameters[symbol].status == "inactive":
        return "inactive: no test reaches it"
    if parameters.numbers[column] == 0.0:
        return "0: this effect is left out"
    return ""


def _is_moved(symbol: str, moved: set[str]) -> bool:
    return any(column in moved for column in (symbol, f"{symbol}_plus", f"{symbol}_minus"))


def _holds(estimate: Estimate | None, truth: float) -> str:
    if estimate is None or estimate.lower is None or estimate.upper is None:
        return NONE
    return "yes" if estimate.lower <= truth <= estimate.upper else "no"


def meaning_of(name: str, stage: StageFit | None = None) -> str:
    """What an unknown is, in words; empty if nothing is known of the name."""
    if (
        stage is not None
        and stage.stage.part == "model"
        and not name.startswith(("offset ", "clock "))
    ):
        return "number of the state at the first sample" if name.startswith("start.") else ""
    side = name.rpartition("_")[2]
    for known, suffix in ((COLUMNS.get(name), side), (name, "")):
        if known in CATALOGUE:
            definition = CATALOGUE[known]
            way = {"plus": ", positive", "minus": ", negative"}.get(suffix, "")
            return definition.name + (way if definition.directional else "")
    if name.startswith("force_"):
        return _force_words(name, stage)
    if name == START_PRESSURE:
        return "stroking pressure at the first sample"
    kind, _, channel = name.partition(" ")
    if kind == "offset":
        return f"free zero of {channel}"
    if kind == "clock":
        return f"lead of the input's clock before that of {channel}"
    return ""


def _white_words(quoted: Sequence[Estimate | None], white: Sequence[Estimate | None]) -> str:
    """Too small as a rule; of residuals that alternate it is the other way round."""
    pairs = [
        (wide.standard_error, narrow.standard_error)
        for wide, narrow in zip(quoted, white, strict=True)
        if wide is not None and narrow is not None
    ]
    ratios = sorted(narrow / wide for wide, narrow in pairs if wide and narrow)
    if ratios and ratios[len(ratios) // 2] > 1.0:
        return "white noise, for comparison"
    return "white noise, too small"


def _force_words(name: str, stage: StageFit | None) -> str:
    """``solenoid force at 0.35 A, positive``."""
    _, side, number = name.split("_")
    way = "positive" if side == "plus" else "negative"
    model = stage.problem.model if stage is not None else None
    if isinstance(model, DriveModel) and model.forces is not None:
        current = (model.forces.plus if side == "plus" else model.forces.minus)[int(number) - 1]
        return f"solenoid force {current:g} A beyond the dead zone, {way}"
    return f"solenoid force, {way}"


def _row(
    stage: StageFit,
    name: str,
    unknown: Unknown,
    value: float,
    estimate: Estimate | None,
    white: Estimate | None,
    bound: str | None,
) -> ParameterRow:
    shown, interval, half, narrow = plain(value), NONE, NONE, NONE
    status = f"at its {bound} bound" if bound is not None else "estimated"
    if estimate is not None:
        status = estimate.status
        if estimate.lower is not None and estimate.upper is not None:
            shown, interval = spread(value, estimate.lower, estimate.upper)
            half = f"±{percent(0.5 * (estimate.upper - estimate.lower), value)}"
    if white is not None and white.lower is not None and white.upper is not None:
        narrow = spread(value, white.lower, white.upper)[1]
    change = (
        NONE
        if unknown.run is not None
        else percent(value - unknown.start, unknown.start, sign=True)
    )
    return ParameterRow(
        name,
        meaning_of(unknown.name, stage),
        unit_text(unknown.unit),
        plain(unknown.start),
        shown,
        change,
        interval,
        half,
        narrow,
        status,
    )
