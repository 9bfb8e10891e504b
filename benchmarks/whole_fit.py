"""What a whole identification takes: fit, judging, report, and 1,000 bootstrap refits.

    .venv/bin/python benchmarks/whole_fit.py [--draws 1000]

The hoist's set-up on a realistic virtual campaign, in one process after a first, unmeasured round.
"""

import argparse
import tempfile
import time
from pathlib import Path
from statistics import median

from swashplate import Campaign
from swashplate.campaign import rig
from swashplate.identification.assessment import assess
from swashplate.identification.executors import Processes
from swashplate.identification.fit import fit
from swashplate.identification.refits import bootstraps_of
from swashplate.identification.setup import load_setup
from swashplate.identification.validation import predict
from swashplate.report.fit_page import write_fit_report

ROUNDS = 5


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=1000)
    wanted = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        tests = rig.run("hoist", seed=1, perturb=0.1)
        campaign = Campaign.from_toml(rig.write(tests, Path(folder) / "virtual"))
        nominal, setup = campaign.drive("hoist").parameters, load_setup("hoist")
        runs, held = campaign.select(role="fit"), campaign.select(role="validate")
        took: dict[str, list[float]] = {"staged fit": [], "judging": [], "report": []}
        for _ in range(ROUNDS + 1):
            begun = time.perf_counter()
            result = fit(runs, nominal, setup)
            fitted = time.perf_counter()
            assessed = assess(result.stages)
            for each in assessed:
                each.identifiability, each.uncertainty, each.runs  # noqa: B018
            predicted = predict(result.parameters, held)
            judged = time.perf_counter()
            write_fit_report(
                result,
                campaign,
                Path(folder) / "report.html",
                assessments=assessed,
                validation=predicted,
            )
            ends = (begun, fitted, judged, time.perf_counter())
            for name, first, last in zip(took, ends, ends[1:], strict=False):
                took[name].append(last - first)
    print("| what | s |")
    print("|---|--:|")
    for name, seconds in took.items():
        print(f"| {name} | {median(seconds[1:]):.2f} |", flush=True)
    if wanted.draws:
        begun = time.perf_counter()
        found = bootstraps_of(assessed, wanted.draws, seed=0, executor=Processes())
        spent = time.perf_counter() - begun
        failed = next(iter(found.values())).failed
        print(f"| {wanted.draws} bootstrap refits of both stages, {failed} failed | {spent:.0f} |")


if __name__ == "__main__":
    main()
