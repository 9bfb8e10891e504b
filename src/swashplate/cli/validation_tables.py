"""Tables of a validation: for the terminal, and for a file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from typer import Exit

from swashplate.cli.terminal import say, show, side, table

if TYPE_CHECKING:
    import polars as pl
    from rich.table import Table

    from swashplate.identification.assessment import Measures, RunQuality
    from swashplate.identification.validation import ErrorTable
    from swashplate.identification.verdict import Verdict


MEASURES = (
    "NRMSE is the RMSE over the standard deviation of what was measured, fit % is 100 (1 - NRMSE); "
    "'of its range' below means RMSE over the largest less the smallest value measured."
)
"""What the errors of the runs are."""
RESIDUALS = (
    "'own' is how long residuals stay correlated, 'input' their largest correlation with the "
    "command, at that lag (positive: after it). Residuals that owe nothing to the command stay "
    "within the band at 95 % of the lags; * marks what lies beyond, as the largest may by chance."
)
"""What the columns of the residuals' table are."""


def quality_tables(qualities: Sequence[RunQuality]) -> list[Table]:
    """A table for each channel: errors of each run and of all, with start and what is ignored."""
    from swashplate.identification.validation import ignored_windows, pooled

    tables = []
    for name, together in pooled(qualities).items():
        alike = [each for each in qualities if each.channel == name]
        unit = alike[0].experiment[name].unit
        factor, shown = _display(unit)
        made = table(
            f"{name}: RMSE in {shown}",
            "run",
            "start",
            "ignored",
            ">RMSE",
            ">NRMSE",
            ">fit %",
            ">R2",
            wrap="ignored",
        )
        for each in alike:
            windows = ignored_windows(each.experiment[name])
            # to the millisecond: jitter of the stamps is no information
            ends = [(round(first, 3) + 0.0, round(last, 3)) for first, last in windows]
            ignored = ", ".join(f"{first:g}-{last:g} s" for first, last in ends) or "nothing"
            made.add_row(
                each.experiment.name, each.experiment.start, ignored, *_cells(each.measures, factor)
            )
        if len(alike) > 1:
            made.add_row("all", "", "", *_cells(together, factor))
        tables.append(made)
    return tables


def _cells(found: Measures, factor: float) -> tuple[str, ...]:
    rmse = f"{factor * found.rmse:.3g}"
    if found.nrmse is None or found.fit_percent is None or found.r_squared is None:
        return rmse, "-", "-", "-"
    return rmse, f"{found.nrmse:.3g}", f"{found.fit_percent:.2f}", f"{found.r_squared:.4f}"


def _display(unit: str) -> tuple[float, str]:
    from math import degrees

    if unit.startswith("rad"):
        return degrees(1.0), unit.replace("rad", "deg")
    return {"A": (1e3, "mA"), "Pa": (1e-5, "bar"), "m": (1e3, "mm")}.get(unit, (1.0, unit))


def errors_table(found: ErrorTable) -> Table:
    """The source's table of one channel: the largest error of each kind of test."""
    made = table(
        f"Largest per cent error of {found.channel}, by kind of test",
        "kind",
        ">error",
        "in",
        ">at",
        ">samples",
        ">runs",
        wrap="in",
    )
    for row in found.rows:
        made.add_row(
            row.kind,
            "-" if row.percent is None else f"{row.percent:.2f} %",
            row.run or "no sample is left",
            "-" if row.time is None else f"{row.time:.2f} s",
            f"{row.samples}",
            f"{row.runs}",
        )
    return made


def left_out(errors: Sequence[ErrorTable]) -> list[str]:
    """What the error tables leave out, each rule that acted once, and what else belongs to them."""
    said = []
    if errors:
        said.append("Per cent of what is measured at that instant.")
    acted = {rule for each in errors for rule in each.acted}
    for rule in dict.fromkeys(rule for each in errors for rule in each.rules):
        if rule not in acted:
            continue
        runs = dict.fromkeys(run for each in errors for run, by in each.left_out if by == rule.name)
        whole = f" All of: {', '.join(runs)}." if runs else ""
        said.append(f"Left out ({rule.name}): {rule.why}{whole}")
    averages = {each.average for each in errors if each.average}
    said += [f"Differences of currents are averaged over {each:g} s." for each in averages]
    unjudged = dict.fromkeys(run for each in errors for run in each.unjudged)
    if unjudged:
        said.append(f"Neither ramp, step nor sine, or too short: {', '.join(unjudged)}.")
    return said


def residual_table(qualities: Sequence[RunQuality]) -> Table:
    """How long residuals stay correlated, and how far they follow the input; see `RESIDUALS`."""
    made = table(
        "Residuals: correlation with themselves and with the input",
        "run",
        "channel",
        ">own",
        ">input",
        "",
        ">95 % band",
        ">lag",
        wrap="run",
    )
    for each in qualities:
        test = each.test
        if test is None:
            continue
        lag, value = test.peak
        made.add_row(
            each.experiment.name,
            each.channel,
            f"{test.duration:.2g} s",
            f"{value:+.2f}",
            "*" if abs(value) > test.cross_band else "",
            f"{test.cross_band:.2f}",
            f"{lag:+.2f} s",
        )
    return made


def measures_table(qualities: Sequence[RunQuality]) -> pl.DataFrame:
    """Measures and residual tests of each channel of each run, SI."""
    import polars as pl

    from swashplate.identification.validation import ignored_windows

    rows = []
    for each in qualities:
        experiment, channel = each.experiment, each.experiment[each.channel]
        found, test = each.measures, each.test
        rows.append(
            {
                "run": experiment.name,
                "manoeuvre": experiment.maneuver,
                "role": experiment.role,
                "channel": each.channel,
                "unit": channel.unit,
                "samples": found.samples,
                "rmse": found.rmse,
                "nrmse": found.nrmse,
                "fit_percent": found.fit_percent,
                "r_squared": found.r_squared,
                "initial_state": experiment.start,
                "ignored": "; ".join(f"{a:.6g} to {b:.6g} s" for a, b in ignored_windows(channel)),
                "residuals_correlated_s": None if test is None else test.duration,
                "correlation_with_input": None if test is None else test.peak[1],
                "correlation_band": None if test is None else test.cross_band,
                "correlation_lag_s": None if test is None else test.peak[0],
            }
        )
    # a column whose first rows are empty must not be taken for text
    return pl.DataFrame(rows, infer_schema_length=None)


def criteria_table(verdict: Verdict) -> Table:
    """The acceptance criteria, those that are not met first."""
    made = table("Acceptance criteria", "criterion", ">value", ">limit", "", wrap="criterion")
    for each in sorted(verdict.criteria, key=lambda each: each.passed):
        made.add_row(each.name, each.value, each.limit, "met" if each.passed else "NOT MET")
    return made


def shown_verdict(verdict: Verdict) -> None:
    """Print criteria, range of validity, what is assumed, and the headline.

    Raises
    ------
    Exit
        With code 1 if what was judged is not usable.
    """
    show(criteria_table(verdict))
    if verdict.assumed:
        say("Assumed, cannot be checked from these logs:")
    for words in verdict.assumed:
        say(f"- {words}")
    if not verdict.usable:
        side.print(verdict.headline)
        raise Exit(1)
    say(verdict.headline)
    if verdict.validity:
        say(verdict.validity)
