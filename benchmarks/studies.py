"""Rows of the table for whole studies: a fit, its report and a full-order run."""

import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median

from processes import limited
from table import Row, duration

from swashplate import Campaign, maneuvers, rig
from swashplate.full_order import FullOrderDrive
from swashplate.identification import (
    Identification,
    fit,
    identifiability_of,
    uncertainty_of,
    whole_drive,
)
from swashplate.report.fit_report import write_fit_report

ROUNDS = 5
FIT, REPORT = 2.0, 3.0
MARCHED, STUDIED = 0.1, 5.0
"""Targets. [s]"""


def fit_study_rows() -> Iterator[Row]:
    """Every number of the hoist on a realistic virtual campaign: fit, judging, report."""
    with tempfile.TemporaryDirectory() as folder:
        tests = rig.run("hoist", seed=1, perturb=0.1)
        campaign = Campaign.from_toml(rig.write(tests, Path(folder) / "virtual"))
        nominal = campaign.drive("hoist").parameters
        setup = whole_drive(nominal)
        runs = campaign.select(role="fit")
        fitted, judged, written = [], [], []
        # the first round is not counted: it compiles, or loads what was compiled
        for _ in range(ROUNDS + 1):
            begin = time.perf_counter()
            found = Identification(campaign, fit(nominal, runs, setup))
            fitted.append(time.perf_counter() - begin)
            begin = time.perf_counter()
            # what a fit says is computed where it is asked for; the verdict predicts and refits
            _ = identifiability_of(found.fit), uncertainty_of(found.fit), found.fit.qualities
            _ = found.verdict
            judged.append(time.perf_counter() - begin)
            begin = time.perf_counter()
            page = Path(folder) / "report.html"
            write_fit_report(found, page)
            written.append(time.perf_counter() - begin)
        yield _limited("complete fit of a virtual hoist", median(fitted[1:]), FIT)
        yield Row("what the fit is worth: intervals, tests", duration(median(judged[1:])))
        yield _limited("its report", median(written[1:]), REPORT)


def full_order_rows() -> Iterator[Row]:
    """30 s of the five-state model, by the compiled march."""
    hoist = FullOrderDrive.preset("hoist")
    command = maneuvers.sine(6.5, 0.1, length=30.0).sample(512.0)
    run = hoist.drive.simulate(command)
    march = _median_of(9, lambda: hoist.follow(run))
    yield _limited("full-order model, compiled march", march, MARCHED)


def _limited(what: str, found: float, limit: float) -> Row:
    return limited(what, found, limit, duration(found), f"< {duration(limit)}")


def _median_of(rounds: int, run: Callable[[], object]) -> float:
    run()
    found = []
    for _ in range(rounds):
        begin = time.perf_counter()
        run()
        found.append(time.perf_counter() - begin)
    return median(found)
