"""What ``swashplate fit`` prints and writes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from swashplate.cli.inputs import DRIVE, NUMBERS
from swashplate.cli.terminal import table
from swashplate.cli.validate import made_folder

if TYPE_CHECKING:
    from rich.table import Table

    from swashplate.campaign import Campaign
    from swashplate.identification.assessment import Assessment, RunQuality
    from swashplate.identification.bootstrap import Bootstrap
    from swashplate.identification.cross_validation import CrossValidation
    from swashplate.identification.fitting import Fit
    from swashplate.identification.uncertainty import Estimate
    from swashplate.parameters.parameter_set import ParameterSet


def estimates_table(
    assessment: Assessment, bootstrap: Bootstrap | None = None, title: str | None = None
) -> Table:
    """Estimates of a stage's unknowns, those of single runs left out, with their intervals."""
    headers = ["unknown", ">nominal", ">estimate", ">95 % interval", ""]
    headers += [">bootstrap", ""] if bootstrap is not None else []
    stage = assessment.stage
    made = table(title or f"Stage {stage.stage.name}", *headers, "unit")
    refitted = bootstrap.intervals() if bootstrap is not None else ()
    unknowns = stage.problem.unknowns
    for k, (each, unknown) in enumerate(
        zip(assessment.uncertainty.estimates, unknowns, strict=True)
    ):
        if unknown.run is not None:
            continue
        cells = [unknown.name, f"{unknown.start:.5g}", f"{each.value:.5g}", *_ends(each)]
        if bootstrap is not None:
            ends = refitted[k]
            cells += ["-", ""] if ends is None else [f"{ends[0]:.5g}", f"{ends[1]:.5g}"]
        made.add_row(*cells, unknown.unit)
    return made


def _ends(estimate: Estimate) -> tuple[str, str]:
    """Both ends of an interval, or in words why there are not two."""
    low, high = estimate.lower, estimate.upper
    if low is None and high is None:
        return estimate.status, ""
    return (
        "none below" if low is None else f"{low:.5g}",
        "none above" if high is None else f"{high:.5g}",
    )


def held_line(fit: Fit) -> str:
    """Which parameters kept their nominal values."""
    numbers = fit.nominal.numbers
    free = {
        target
        for each in fit.stages
        for unknown in each.problem.unknowns
        for target in unknown.targets
    }
    forces = any(each.stage.forces is not None for each in fit.stages)
    solenoids = ("Z19", "Z20", "Z21", "Z22")
    held = dict.fromkeys(
        name.removesuffix("_plus").removesuffix("_minus")
        for name in numbers
        if name not in free and not (forces and name.startswith(solenoids))
    )
    free_symbols = {name.removesuffix("_plus").removesuffix("_minus") for name in free}
    listed = ", ".join(name for name in held if name not in free_symbols)
    return f"Held at their nominal values: {listed or 'none'}."


def quality_table(title: str, runs: Sequence[RunQuality]) -> Table:
    """Errors and fit % of runs, with start and ignored share beside them."""
    from math import degrees

    made = table(title, "run", "channel", "start", ">ignored", ">RMSE", "", ">fit %", wrap="run")
    for each in runs:
        channel = each.experiment[each.channel]
        rmse, unit = each.measures.rmse, channel.unit
        if unit.startswith("rad"):
            rmse, unit = degrees(rmse), unit.replace("rad", "deg")
        elif unit == "A":
            rmse, unit = 1e3 * rmse, "mA"
        ignored = 1.0 - channel.used.mean()
        made.add_row(
            each.experiment.run,
            each.channel,
            each.experiment.start,
            f"{100.0 * ignored:.3g} %",
            f"{rmse:.3g}",
            unit,
            "-" if each.measures.fit_percent is None else f"{each.measures.fit_percent:.2f}",
        )
    return made


def folds_table(found: CrossValidation) -> Table:
    """Errors over all parts, each predicted by the fit to the others."""
    made = table(
        "Cross-validation: each part predicted by a fit to the others", "channel", ">fit %"
    )
    for name, measures in found.measures.items():
        percent = measures.fit_percent
        made.add_row(name, "-" if percent is None else f"{percent:.2f}")
    return made


def told(fit: Fit, assessments: Sequence[Assessment], campaign: Campaign) -> ParameterSet:
    """The fitted set, where each number says whether it was fitted or fixed, and where it is from.

    Of a fitted one the source is campaign, date and 95 % interval; of a fixed one that of the set
    which the fit began from.
    """
    from dataclasses import replace
    from datetime import date

    from swashplate.parameters.definitions import find
    from swashplate.parameters.parameter_set import ParameterSet

    found, nominal, today = fit.drive.parameters, fit.nominal, f"{date.today():%d %b %Y}"
    assert isinstance(nominal, ParameterSet)
    ends: dict[str, list[str]] = {}
    for each in assessments:
        unknowns = each.stage.problem.unknowns
        for estimate, unknown in zip(each.uncertainty.estimates, unknowns, strict=True):
            if unknown.run is not None:
                continue
            if unknown.name.startswith("force_"):
                for symbol in ("Z19", "Z20", "Z21", "Z22"):
                    ends[symbol] = ["from the fitted forces"]
                continue
            low, high = _ends(estimate)
            interval = f"{low} to {high}" if high else low
            for target in unknown.targets:
                if target in found.numbers:
                    side = target.rpartition("_")[2]
                    side = f"{side} " if side in ("plus", "minus") else ""
                    ends.setdefault(find(target).symbol, []).append(f"{side}{interval}")
    origin = f"{campaign.path.name}, {today}"
    parameters = {}
    for symbol, parameter in found.parameters.items():
        if symbol in ends:
            words = "; ".join(ends[symbol])
            parameter = replace(parameter, status="fitted", source=f"{origin}; 95 %: {words}")
        elif parameter.status != "inactive":
            before = nominal.parameters.get(symbol, parameter)
            source = f"{nominal.name}: {before.source}" if before.source else nominal.name
            parameter = replace(parameter, status="fixed", source=source)
        parameters[symbol] = parameter
    title = f"{campaign.title}: fitted to {len(fit.stages[0].problem.experiments)} runs, {today}"
    return replace(found, title=title, parameters=parameters)


def written(
    fit: Fit,
    assessments: Sequence[Assessment],
    campaign: Campaign,
    out: Path,
    bootstraps: Mapping[str, Bootstrap] | None = None,
) -> list[str]:
    """Write the drive and the estimates; lines that say so."""
    import polars as pl
    from tomlkit import dumps

    from swashplate.drive import Drive
    from swashplate.identification.own_model import ModelParameters
    from swashplate.tables import write_table, write_text

    made_folder(out)
    if isinstance(fit.parameters, ModelParameters):
        found = {name: float(value) for name, value in fit.parameters.numbers.items()}
        write_text(dumps({fit.parameters.name: found}), out / NUMBERS)
        lines = [f"Numbers:   {out / NUMBERS}"]
    else:
        Drive(told(fit, assessments, campaign)).to_toml(out / DRIVE)
        lines = [f"Drive:     {out / DRIVE}"]
    rows = []
    for each in assessments:
        bootstrap = (bootstraps or {}).get(each.stage.stage.name)
        refitted = bootstrap.intervals() if bootstrap is not None else None
        unknowns = each.stage.problem.unknowns
        for k, (estimate, unknown) in enumerate(
            zip(each.uncertainty.estimates, unknowns, strict=True)
        ):
            row = {
                "stage": each.stage.stage.name,
                "unknown": estimate.name,
                "unit": unknown.unit,
                "nominal": unknown.start,
                "estimate": estimate.value,
                "lower 95 %": estimate.lower,
                "upper 95 %": estimate.upper,
                "standard error": estimate.standard_error,
                "status": estimate.status,
            }
            if refitted is not None:
                ends = refitted[k]
                row["bootstrap lower 95 %"] = None if ends is None else ends[0]
                row["bootstrap upper 95 %"] = None if ends is None else ends[1]
            rows.append(row)
    write_table(pl.DataFrame(rows, infer_schema_length=None), out / "estimates.csv")
    return [*lines, f"Estimates: {out / 'estimates.csv'}"]
