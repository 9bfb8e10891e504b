"""First screen of a report, for the machine's owner: verdict, curves, numbers, next steps."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from markupsafe import Markup

from swashplate.campaign import Campaign
from swashplate.drive import KeyNumbers
from swashplate.identification import (
    Optimum,
    Verdict,
    input_correlations,
    percent,
    pooled_measures,
    range_of,
    tested_commands,
)
from swashplate.identification.statistics import FULL, weak_unknowns
from swashplate.parameters import FITTED_DRIVE
from swashplate.report.fit_report.html_page import PageBlock, Section, listed_block, text
from swashplate.report.fit_report.runs import ShownRun
from swashplate.tables import count, listed

Light = Literal["good", "look", "bad"]

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
    key_numbers: KeyNumbers | None,
    fit: Optimum | None,
    runs: Sequence[ShownRun],
    findings: int,
    *,
    folder: Path,
) -> Section:
    """The first screen; a user-defined model has no numbers that matter.

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
    if key_numbers is not None:
        numbers.append(PageBlock("heading", "Numbers that matter", "h3"))
        if key_numbers.numbers:
            numbers.append(PageBlock("table", key_numbers.table(), "numbers"))
        numbers.append(text(" ".join(key_numbers.basis), "remark"))
        limits.append(PageBlock("heading", "What limits it", "h3"))
        limits += listed_block(key_numbers.what_limits)
    limits.append(PageBlock("heading", "What to do next", "h3"))
    limits += listed_block(_next_steps(judged, campaign, fit, runs, findings, folder))
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


def _next_steps(
    judged: Verdict,
    campaign: Campaign,
    fit: Optimum | None,
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
    weak = weak_unknowns(fit) if fit else []
    subject = "model" if fit and fit.setup.part == "model" else "drive"
    named = listed(weak[:6]) if len(weak) <= 6 else f"{', '.join(weak[:6])} and others"
    if weak and subject == "model":
        steps.append(f"Not determined to within ±10 %: {named}. Add tests that move them.")
    elif fit and weak:
        code = Markup(
            "Not determined to within ±10 %: {}. The tests that would determine them are ranked, "
            "in the folder of the fit, by <code>{}</code>."
        )
        steps.append(code.format(named, _advise_command(campaign, fit, folder)))
    if fit and not any(run.role == "validate" for run in runs):
        steps.append('Hold a run out of the fit (role = "validate"): nothing was predicted yet.')
    if judged.usable:
        advice = f"Use the {subject}"
        steps.append(f"{advice}. {judged.validity}" if judged.validity else f"{advice}.")
        if fit and subject == "drive":
            plus, minus = tested_commands(fit.problem.experiments) or FULL
            volts = plus or -minus
            code = Markup("Try it in the folder of the fit: <code>{}</code>.")
            step = f"step:{volts:g}"
            steps.append(code.format(f"swashplate simulate {FITTED_DRIVE} {step}"))
    return steps


def _advise_command(campaign: Campaign, fit: Optimum, folder: Path) -> str:
    """The command that ranks further tests, as it runs in the folder of the fit."""
    tests = os.path.relpath(campaign.path, folder)
    command = ["swashplate", "advise", tests, "--drive", FITTED_DRIVE, "--setup", "setup.toml"]
    if len(campaign.axes) > 1:
        command += ["--axis", fit.problem.experiments[0].axis]
    return shlex.join(command)
