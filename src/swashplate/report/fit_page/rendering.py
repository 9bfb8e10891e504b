"""What every report page has: its sections, runs, figures and the template that holds them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any, NamedTuple

from bokeh.resources import Resources
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from swashplate.campaign import Campaign
from swashplate.identification.assessment import ResidualTest
from swashplate.identification.own_model import ModelParameters
from swashplate.identification.staging import Parameters
from swashplate.identification.validation import source_rules
from swashplate.report.fit_page.error_sections import error_sections
from swashplate.report.fit_page.numbers import count, fixed, plain
from swashplate.report.fit_page.run_data import run_data
from swashplate.report.fit_page.run_plots import stack_item, stack_of, stacks_of
from swashplate.report.fit_page.run_tables import data_rows, quality_row, quality_rows
from swashplate.report.fit_page.runs import ShownRun
from swashplate.report.fit_page.small_charts import (
    SmallChart,
    autocorrelation_chart,
    cross_correlation_chart,
)


class Section(NamedTuple):
    """A section of a page."""

    id: str
    """Of its template, ``sections/ID.html``, and its anchor."""
    heading: str


class ResidualRow(NamedTuple):
    """The test of one channel's residuals in one run."""

    run: str
    role: str
    channel: str
    autocorrelation: SmallChart
    cross_correlation: SmallChart
    verdict: str


def shared_content(
    campaign: Campaign, runs: Sequence[ShownRun], drive: Parameters
) -> dict[str, Any]:
    """What the template needs of drive and runs, whatever the page is about.

    Figures of the runs are in ``"items"``, to which a page adds its own.
    """
    axes = {run.experiment.axis for run in runs}
    data = data_rows([each for each in campaign if each.axis in axes])
    stacks = stacks_of(runs)
    return {
        "title": campaign.title,
        "virtual": campaign.virtual,
        "campaign": campaign,
        "drive": drive,
        "own_model": isinstance(drive, ModelParameters),
        "runs": [
            (run, stacks[stack_of(run)], [quality_row(run, each) for each in run.channels])
            for run in runs
        ],
        "quality": quality_rows(runs),
        "errors": error_sections(runs, source_rules(drive.name)),
        "residuals": _residual_rows(runs),
        "data": data,
        "findings": sum(len(row.findings) for row in data),
        "items": {name: stack_item(stack) for stack, name in stacks.items()},
        "run_data": [_script_json(run_data(run)) for run in runs],
    }


def rendered(sections: Sequence[Section], content: Mapping[str, Any]) -> str:
    """The page's HTML."""
    items = {name: _script_json(item) for name, item in content["items"].items()}
    page: str = (
        _environment()
        .get_template("page.html")
        .render(
            {**content, "items": items},
            sections=sections,
            bokeh=Markup(Resources(mode="inline", components=["bokeh"], log_level="warn").render()),
            css=Markup(_text("page.css")),
            js=Markup(_text("page.js")),
        )
    )
    return page


def _residual_rows(runs: Sequence[ShownRun]) -> list[ResidualRow]:
    rows = []
    for run in runs:
        for each in run.channels:
            test: ResidualTest | None = each.quality.test
            if test is None:
                continue
            rows.append(
                ResidualRow(
                    run.experiment.name,
                    run.role,
                    each.quality.channel,
                    autocorrelation_chart(test),
                    cross_correlation_chart(test),
                    test.verdict,
                )
            )
    return rows


def _script_json(content: Any) -> Markup:
    """JSON that can stand in a script element: no text in it can end the element."""
    text = json.dumps(content, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return Markup(text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e"))


def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("swashplate.report.fit_page", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"plain": plain, "fixed": fixed}
    environment.globals["count"] = count
    return environment


def _text(name: str) -> str:
    return files("swashplate.report.fit_page").joinpath(name).read_text("utf-8")
