"""First screen of a report, for the machine's owner: verdict, curves, numbers, next steps."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterable, Mapping, Sequence
from math import ceil, floor, log10
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from swashplate.analysis import (
    ERROR_OF_ASSUMED,
    assumed_parameters,
    changes_left_open,
    dead_zone,
    limit_shares,
    standard_errors,
    variances_from_bounds,
    without_limits,
)
from swashplate.campaign import Campaign
from swashplate.drive import Drive
from swashplate.errors import SwashplateError
from swashplate.identification import (
    StageFit,
    Verdict,
    input_correlations,
    percent,
    pooled_measures,
    range_of,
)
from swashplate.identification.statistics import (
    FULL,
    Commands,
    commands_each_way,
    unseen_limits,
    weak_unknowns,
)
from swashplate.parameters import FITTED_DRIVE, FULL_VOLTAGE
from swashplate.report.fit_report.html_page import PageBlock, Section, listed_block, text
from swashplate.report.fit_report.runs import ShownRun
from swashplate.tables import NONE, UNIT, Cell, Column, Table, count, listed
from swashplate.units import display_unit

Array = NDArray[np.float64]
Light = Literal["good", "look", "bad"]

RATE, SECONDS = 512.0, 8.0
"""Of the full step that the numbers are read from. [Hz, s]"""
MOVES, MOST_OF_IT = 0.02, 0.63
"""Parts of the top speed at which the delay ends, and the lag."""
QUANTILE = 1.96
"""Standard deviations on either side of a 95 % interval."""
OPEN = 0.1
"""Share of a number by which limits that no test reached can move it, from which it has one end
alone; what moves it by less is taken into its interval. [1]"""
LEANS = 0.1
"""Share of a number's variance that goes with an estimate at its bound, from which it has no
interval: 5 % of its width. [1]"""
FOLLOWS = 0.01
"""Share of a number by which 5 % of what the tests do not determine can move it, from which it has
no interval. [1]"""


# --- numbers --------------------------------------------------------------------------------------

DEAD_ZONE, TOP_SPEED, ACCELERATION, DELAY, LAG, CREEP = range(6)
"""Rows of the numbers."""


def machine_numbers_of(drive: Drive, largest: Commands = FULL) -> Array:
    """Characteristic numbers of a drive, (6, 2): each way, positive and negative. SI

    Dead zone [V]; top speed [rad/s], steady under the largest command; largest acceleration
    [rad/s²], delay and lag [s] of a step from rest to the largest command, the delay up to 2 % of
    the change to the speed that settles, the lag from there to 63 %; creep, the steady speed
    at 0 V [rad/s]. NaN where the drive has none.
    """
    rest = float(drive.steady_speed(0.0))
    numbers = np.full((6, 2), np.nan)
    for side, direction in enumerate((1.0, -1.0)):
        volts = direction * largest[side]
        command = np.full(int(SECONDS * RATE) + 1, volts)
        command[0] = 0.0
        run = drive.simulate(command, RATE, start="steady")
        final = float(drive.steady_speed(volts))
        numbers[DEAD_ZONE, side] = dead_zone(drive, direction).inside
        numbers[TOP_SPEED, side] = final
        numbers[CREEP, side] = rest
        if final == rest:
            continue
        steepest = float((direction * np.diff(run.shaft_speed)).max())
        numbers[ACCELERATION, side] = direction * RATE * steepest
        change = np.maximum.accumulate((run.shaft_speed - rest) / (final - rest))
        if change[-1] >= MOST_OF_IT:
            begin, end = np.interp((MOVES, MOST_OF_IT), change, run.time)
            numbers[DELAY, side] = begin
            numbers[LAG, side] = end - begin
    return numbers


def largest_commands(stages: Sequence[StageFit]) -> Commands:
    """Largest command each way of the runs that a fit is of, ±10 V for a way that none goes.

    A step to a larger one would show what no test did.
    """
    plus, minus = (volts or FULL_VOLTAGE for volts in tested_commands(stages))
    return plus, minus


def tested_commands(stages: Sequence[StageFit]) -> Commands:
    """Largest command each way of the runs that a fit is of, 0 for a way that none goes."""
    runs = [run for stage in stages for run in stage.problem.experiments]
    return commands_each_way(
        (float(run.input.values.min()), float(run.input.values.max()))
        for run in runs
        if run.input.kind == "voltage"
    )


class _Range(NamedTuple):
    """Possible error of the machine's numbers (6, 2)."""

    half: Array
    """Half widths of 95 % intervals, NaN if there is none."""
    doubt: NDArray[np.object_]
    """Why a number has no interval, in words; empty if it has one."""
    near: Array
    """The numbers if limits that were not seen lie where the tests ended, as cautious ends."""
    far: Array
    """The numbers if there are no such limits."""


def numbers_table(drive: Drive, stages: Sequence[StageFit]) -> tuple[Table, list[str]]:
    """The numbers that matter, each with its 95 % interval, and what these leave out.

    A number that depends on a limit which no test reached has only one end, "at least" or "at
    most".
    Without stages of a fit there are no intervals.
    """
    largest = largest_commands(stages)
    values = machine_numbers_of(drive, largest)
    sentences = list[str]()
    range_ = _Range(
        half=np.full((6, 2), np.nan),
        doubt=np.full((6, 2), "", dtype=object),
        near=values,
        far=values,
    )
    if stages:
        try:
            range_ = _range_of(drive, stages, values, largest)
        except SwashplateError as error:
            sentences.append(f"There are no intervals: {error}")
    table = Table("", (Column("quantity"), Column("positive", "s"), Column("negative", "s"), UNIT))
    plus, minus = largest
    commands = f"±{plus:.3g} V" if plus == minus else f"{plus:.3g} and -{minus:.3g} V"
    rows = (
        ("Dead zone, up to", "V"),
        (f"Top speed at {commands}", "rad/s"),
        ("Largest acceleration", "rad/s^2"),
        ("Delay, to 2 % of final speed", "s"),
        ("Lag, from there to 63 %", "s"),
        ("Creep at 0 V", "rad/s"),
    )
    for row, (label, unit) in enumerate(rows):
        factor = display_unit(unit, float(np.nanmax(np.abs(values[row]), initial=0.0))).factor
        positive = _cell(factor, values, range_, (row, 0))
        negative = _cell(factor, values, range_, (row, 1))
        if row == CREEP:  # the same both ways
            negative = Cell(None, "")
        table.add(label, positive, negative, unit=unit, spec=".3f")
    if stages and assumed_parameters(stages):
        sentences.append(
            f"Assumed parameters are taken as known to {percent(ERROR_OF_ASSUMED)} (standard "
            "deviation)."
        )
    if largest != FULL:
        sentences.append(
            "Top speed, acceleration, delay and lag are those of steps from rest to "
            f"{largest[0]:.3g} and -{largest[1]:.3g} V, the largest commands of the fitted runs."
        )
    return table, sentences


def _at_limits(drive: Drive, limits: Mapping[str, float]) -> Drive:
    """A drive whose limits lie where the tests went, by column."""
    return Drive(drive.parameters.with_numbers(limits))


def _range_of(drive: Drive, stages: Sequence[StageFit], values: Array, largest: Commands) -> _Range:
    """Errors of the numbers: of what the tests determine, and of unseen limits by both ends."""

    def numbers(drive: Drive) -> Array:
        return machine_numbers_of(drive, largest)

    unseen = unseen_limits(stages)
    assumed = assumed_parameters(stages)
    errors = standard_errors(stages, numbers, assumed)
    half = QUANTILE * errors
    nearest, farthest = _at_limits(drive, unseen), without_limits(drive, unseen)
    near, far = machine_numbers_of(nearest, largest), machine_numbers_of(farthest, largest)
    largest_change = np.maximum(np.abs(near - values), np.abs(far - values))
    left_open = np.abs(far - near) > OPEN * np.abs(near)
    doubt = np.full((6, 2), "", dtype=object)
    for name, variances in variances_from_bounds(stages, numbers, unseen).items():
        # a number with only one end has no interval to lose
        doubt[~left_open & (variances > LEANS * errors**2)] = f"{name} {AT_BOUND}"
    doubt[changes_left_open(stages, numbers, unseen) > FOLLOWS * np.abs(values)] = "not determined"
    for side, volts in enumerate(tested_commands(stages)):
        if volts == 0.0:
            doubt[:CREEP, side] = "not tested"
    for side, column in enumerate(("Z16_plus", "Z16_minus")):
        if mistaken_for_a_lag(column, stages, unseen):
            # the lag is the same both ways, and the delay follows it
            doubt[ACCELERATION, side] = doubt[DELAY : LAG + 1] = f"{column} fixed"
    if left_open.any():
        at_ends = standard_errors(
            stages, lambda varied: machine_numbers_of(_at_limits(varied, unseen), largest)
        )
        cautious = QUANTILE * at_ends * np.sign(near)
        near = np.where(np.abs(far) > np.abs(near), near - cautious, near + cautious)
    half = np.where(left_open, np.nan, half + largest_change)
    near, far = np.where(left_open, near, values), np.where(left_open, far, values)
    return _Range(half, doubt, near, far)


INTERVALS = "With 95 % intervals of the fit, rounded up, which do not cover unmodelled effects."
AT_BOUND = "at its bound"
MEANINGS = {
    "not seen": "Not seen: no test reached the limit that decides it.",
    "not tested": "Not tested: no run moves in that direction.",
    "not determined": "Not determined: it depends on parameters that the tests do not determine.",
    AT_BOUND: "At its bound: depends on an estimate that ended at a bound of its search; size and "
    "sign of its error are not known.",
    "(fixed)": "Fixed: depends on parameters that were not fitted.",
    "Z16_": "Z16 fixed: the fit did not estimate an orifice, which can be mistaken for a lag.",
}
"""Meaning of the words that are shown next to a number."""


def _meanings(table: Table) -> list[str]:
    """Meanings of the words that a table of numbers uses."""
    cells = list[str]()
    for row in table.rows:
        cells += [cell.text for cell in row.cells if isinstance(cell, Cell)]
    return [meaning for word, meaning in MEANINGS.items() if any(word in cell for cell in cells)]


def mistaken_for_a_lag(
    column: str, stages: Sequence[StageFit], unseen: Mapping[str, float]
) -> bool:
    """Whether an orifice that no stage estimates may have been mistaken for an estimated lag.

    Of a limited acceleration a fit without the limit makes a longer lag, and says nothing.
    """
    free = set[str]()
    for stage in stages:
        for unknown in stage.problem.unknowns:
            free.update(unknown.targets)
    return column in unseen and column not in free and "Z8" in free


def _cell(factor: float, values: Array, range_: _Range, index: tuple[int, int]) -> Cell:
    """A number as it is printed: with its interval, or as the end of what is possible."""
    value = factor * values[index]
    half = factor * range_.half[index]
    near, far = factor * range_.near[index], factor * range_.far[index]
    if not np.isfinite(value):
        return Cell(None, NONE)
    if range_.doubt[index]:
        has_half = 0.0 < half < np.inf
        number = f"{value:.{_decimals(value, half)}f}" if has_half else f"{value:.4g}"
        return Cell(value, f"{_unsigned_zero(number)} ({range_.doubt[index]})")
    if near != far:
        at_least = abs(far) > abs(near)
        end = "least" if at_least else "most"
        return Cell(near, f"at {end} {_three_digits(near, towards_zero=at_least)}, not seen")
    if half <= 1e-9 * abs(value):
        # it depends only on parameters that the fit left at their nominal values
        return Cell(value, f"{value:.4g} (fixed)")
    if not np.isfinite(half):
        return Cell(value, f"{value:.4g}")
    decimals = _decimals(value, half)
    upwards = ceil(half * 10.0**decimals - 1e-9) / 10.0**decimals
    number = _unsigned_zero(f"{value:.{decimals}f}")
    return Cell(value, f"{number} ± {upwards:.{decimals}f}")


def _decimals(value: float, half: float) -> int:
    """As many as an interval gives sense to, and no more than an engineer would write down."""
    decimals = 1 - floor(log10(half))
    return max(min(decimals, 3 - floor(log10(max(abs(value), half)))), 0)


def _unsigned_zero(number: str) -> str:
    """A number as it is printed, a zero without a sign."""
    return number if float(number) else number.removeprefix("-")


def _three_digits(value: float, towards_zero: bool) -> str:
    """Round a number to three digits, towards 0 or away from it."""
    if value == 0.0:
        return "0"
    decimals = 2 - floor(log10(abs(value)))
    digits = abs(value) * 10.0**decimals
    size = (floor(digits) if towards_zero else ceil(digits)) / 10.0**decimals
    return f"{np.copysign(size, value):.{max(decimals, 0)}f}"


# --- lights ---------------------------------------------------------------------------------------


def light(look: Light, meaning: str) -> Markup:
    """A traffic light with its meaning, which does not rest only on its colour."""
    sign = {"good": "✓", "look": "!", "bad": "✗"}[look]
    template = Markup('<span class="light {}" title="{}" role="img" aria-label="{}">{}</span>')
    return template.format(look, meaning, meaning, sign)


def run_error(run: ShownRun, runs: Sequence[ShownRun]) -> float:
    """RMSE of a run's judged channel over its range in all runs of its role, as the verdict has it.

    Infinite if nothing moves.
    """
    judged_channel = run.judged
    judged = [other_run.judged for other_run in runs if other_run.role == run.role]
    reach = range_of(
        [other_run for other_run in judged if other_run.channel == judged_channel.channel]
    )
    if not reach > 0.0:
        return np.inf
    return (
        pooled_measures([judged_channel], without_noise=True)[judged_channel.channel].rmse / reach
    )


def run_lights(
    runs: Sequence[ShownRun], findings: dict[str, list[int]], judged: Verdict
) -> list[tuple[Light, str]]:
    """For each run its light and why: unsound, or with findings on its data, or neither.

    Findings on the data are by the name of their run.
    """
    unsound = {doubt.run for doubt in judged.unsound}
    lights = list[tuple[Light, str]]()
    for run in runs:
        name = run.experiment.name
        look = [
            f"residuals of {channel.quality.channel} follow the input"
            for channel in run.channels
            if input_correlations([channel.quality], channel.quality.channel)[1]
        ]
        if run_findings := findings.get(name, []):
            look.append(count(len(run_findings), "finding"))
        if name in unsound:
            lights.append(("bad", "not sound"))
        else:
            lights.append(("look", "; ".join(look)) if look else ("good", "as the others"))
    return lights


# --- section --------------------------------------------------------------------------------------


def summary_section(
    judged: Verdict,
    campaign: Campaign,
    drive: Drive | None,
    stages: Sequence[StageFit],
    runs: Sequence[ShownRun],
    findings: int,
    *,
    folder: Path,
) -> Section:
    """The first screen: `drive` is None for a user-defined model, which has no such numbers.

    Commands are printed as they run in `folder`, that of the report.
    """
    look: Light = "good" if judged.usable else "bad"
    headline = judged.headline.replace(" %", "\N{NO-BREAK SPACE}%")
    blocks = [
        PageBlock(
            "verdict", (light(look, "Usable" if judged.usable else "Not usable"), headline), look
        )
    ]
    blocks.append(PageBlock("pair", list(_curve_blocks(runs, campaign.virtual))))
    numbers = []
    limits = []
    if drive is not None:
        numbers.append(PageBlock("heading", "Numbers that matter", "h3"))
        table = None
        try:
            table, remarks = numbers_table(drive, stages)
            numbers.append(PageBlock("table", table, "numbers"))
        except SwashplateError as error:
            remarks = [f"This drive has none: {error}"]
        if stages:
            remarks = [INTERVALS, *(_meanings(table) if table else ()), *remarks]
        numbers.append(text(" ".join(remarks), "remark"))
        limits.append(PageBlock("heading", "What limits it", "h3"))
        limits += listed_block(_limit_sentences(drive, stages))
    limits.append(PageBlock("heading", "What to do next", "h3"))
    limits += listed_block(_next_steps(judged, campaign, stages, runs, findings, folder))
    blocks.append(
        PageBlock("pair", [PageBlock("tile", tile) for tile in (numbers, limits) if tile])
    )
    return Section("summary", "Summary", blocks)


def _curve_blocks(runs: Sequence[ShownRun], virtual: bool) -> Iterable[PageBlock]:
    """The runs that are predicted best and worst, of those held out if there are any."""
    held_out = [k for k, run in enumerate(runs) if run.role == "validate"]
    ordered = sorted(held_out or range(len(runs)), key=lambda k: run_error(runs[k], runs))
    ends = {"Best": ordered[0], "Worst": ordered[-1]} if len(ordered) > 1 else {"The": ordered[0]}
    for which, k in ends.items():
        kind = "held-out run" if held_out else "fitted run"
        part = run_error(runs[k], runs)
        error = "never moves" if part == np.inf else f"error {percent(part)} of the range"
        content = {
            "number": k,
            "run": runs[k],
            "words": f"{which} {kind}: {runs[k].name}, {error}",
            "channel": len(runs[k].channels) - 1,
            "measured": "virtual test" if virtual else "measured",
        }
        yield PageBlock("curve", content)


def _limit_sentences(drive: Drive, stages: Sequence[StageFit]) -> list[str]:
    """Say which limits act during a step each way, and which to change first.

    The steps go to the largest commands that were tested; a value that no test reached does not
    count as a limit.
    """
    length = int(2.0 * RATE)
    plus, minus = largest_commands(stages)
    command = np.repeat((0.0, plus, 0.0, -minus, 0.0), length)
    try:
        limited = without_limits(drive, unseen_limits(stages)) if stages else drive
        limit_times = limit_shares(limited, command, RATE, interpolation="previous")
    except SwashplateError as error:
        return [str(error)]
    acting = sorted(limit_times.shares, key=lambda limit: limit.time_share or 0.0, reverse=True)
    shares = [
        f"{limit.limit} {percent(limit.time_share)}" for limit in acting[:3] if limit.time_share
    ]
    heading = f"Share of the time of steps from rest to {plus:.3g} and -{minus:.3g} V and back"
    return [f"{heading}: {', '.join(shares) or 'nothing acts'}.", *limit_times.sentences()[:1]]


def _next_steps(
    judged: Verdict,
    campaign: Campaign,
    stages: Sequence[StageFit],
    runs: Sequence[ShownRun],
    findings: int,
    folder: Path,
) -> list[str | Markup]:
    steps: list[str | Markup] = [f"Settle first: {sentence}." for sentence in judged.unfinished]
    steps += [f"Settle first: {finding.sentence}" for finding in judged.unsound[:3]]
    if judged.cause:
        steps.append(f"Error beyond noise: {judged.cause}")
    if findings:
        link = Markup('Look into the <a href="#data">{}</a> on the logs.')
        steps.append(link.format(count(findings, "finding")))
    weak = [name for stage in stages for name in weak_unknowns(stage)]
    subject = "model" if any(stage.stage.part == "model" for stage in stages) else "drive"
    named = listed(weak[:6]) if len(weak) <= 6 else f"{', '.join(weak[:6])} and others"
    if weak and subject == "model":
        steps.append(f"Not determined to within ±10 %: {named}. Add tests that move them.")
    elif weak:
        code = Markup(
            "Not determined to within ±10 %: {}. The tests that would determine them are ranked, "
            "in the folder of the fit, by <code>{}</code>."
        )
        steps.append(code.format(named, _advise_command(campaign, stages, folder)))
    if stages and not any(run.role == "validate" for run in runs):
        steps.append('Hold a run out of the fit (role = "validate"): nothing was predicted yet.')
    if judged.usable:
        advice = f"Use the {subject}"
        steps.append(f"{advice}. {judged.validity}" if judged.validity else f"{advice}.")
        if stages and subject == "drive":
            plus, minus = tested_commands(stages)
            volts = plus or -minus
            code = Markup("Try it in the folder of the fit: <code>{}</code>.")
            step = f"step:{volts:.2g}"  # to more digits it is noise of the log
            steps.append(code.format(f"swashplate simulate {FITTED_DRIVE} {step}"))
    return steps


def _advise_command(campaign: Campaign, stages: Sequence[StageFit], folder: Path) -> str:
    """The command that ranks further tests, as it runs in the folder of the fit."""
    tests = os.path.relpath(campaign.path, folder)
    command = ["swashplate", "advise", tests, "--drive", FITTED_DRIVE, "--setup", "setup.toml"]
    if len(campaign.axes) > 1:
        command += ["--axis", stages[0].problem.experiments[0].axis]
    return shlex.join(command)
