"""What a stage was asked to do, as the report's last section states it."""

from __future__ import annotations

from typing import NamedTuple

from swashplate.identification.fitting import StageFit
from swashplate.identification.unknowns import Unknown
from swashplate.report.display_units import display_unit
from swashplate.report.fit_page.numbers import listed, plain, unit_text


class FreeRow(NamedTuple):
    """An unknown, and within which bounds it could move."""

    name: str
    unit: str
    start: str
    low: str
    high: str
    moved: str
    """``"logarithm"`` or ``"value"``."""
    prior: str


class StageRows(NamedTuple):
    """The set-up of one stage."""

    name: str
    words: tuple[str, ...]
    free: tuple[FreeRow, ...]


_PARTS = {
    "card": "the control card alone, from the command to the currents",
    "pump": "pump and motor, driven by the current",
    "chain": "the whole chain, from the command to the speed",
    "model": "a model of one's own, from its inputs to its channels",
}


def stage_rows(fit: StageFit) -> StageRows:
    """The set-up of one stage as text."""
    stage, problem = fit.stage, fit.problem
    words = [f"Simulates {_PARTS[stage.part]}."]
    if stage.part == "pump":
        words.append(f"The current is the {stage.current} one.")
    words.append(f"Fits {listed(list(problem.channels))}.")
    words.append(
        "One unit of residual is "
        + listed([_scale(fit, name, size) for name, size in problem.scales.items()])
        + "."
    )
    for kind, windows in stage.weights.items():
        words += [f"Weight on {kind.replace('_', ' ')}: {_window(each)}." for each in windows]
    free = tuple(_free(each) for each in problem.unknowns if each.run is None)
    own = sum(each.run is not None for each in problem.unknowns)
    if own:
        words.append(f"Besides there are {own} unknowns of single runs, bounded out of reach.")
    return StageRows(stage.name, tuple(words), free)


def _scale(fit: StageFit, name: str, size: float) -> str:
    having = next(each for each in fit.problem.experiments if name in each.channels)
    unit = display_unit(having[name].unit, size)
    return f"{plain(unit.factor * size, 3)} {unit.name} of {name}"


def _window(weight: object) -> str:
    given = {key: value for key, value in vars(weight).items() if value not in (None, "")}
    factor = given.pop("factor")
    start, stop = given.get("start"), given.get("stop")
    when = (
        "all of the run"
        if start is None and stop is None
        else f"{'the start' if start is None else f'{start:g} s'} to "
        f"{'the end' if stop is None else f'{stop:g} s'}"
    )
    where = f" in '{given['maneuver']}'" if "maneuver" in given else ""
    why = f" ({given['why']})" if "why" in given else ""
    return f"{factor:g} on {when}{where}{why}"


def _free(unknown: Unknown) -> FreeRow:
    prior = unknown.prior
    return FreeRow(
        unknown.name,
        unit_text(unknown.unit),
        plain(unknown.start),
        plain(unknown.low),
        plain(unknown.high),
        "logarithm" if unknown.log else "value",
        "" if prior is None else f"{plain(prior.mean)} ± {plain(prior.deviation)}",
    )
