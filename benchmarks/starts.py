"""How many random starts reach the best cost, by trust region and by SQP with differences.

    .venv/bin/python benchmarks/starts.py [--starts 50] [--sqp-starts 50]

The stages of the hoist's set-up on a realistic virtual campaign, from Sobol points over all bounds.
"""

import argparse
import tempfile
import time
from pathlib import Path
from statistics import median

from swashplate import Campaign
from swashplate.campaign import rig
from swashplate.identification.executors import Processes
from swashplate.identification.fit import fit, smooth
from swashplate.identification.setup import load_setup
from swashplate.identification.staging import stage_problem
from swashplate.identification.starts import sobol_starts, solve_from

REACHED = 1.001
"""A start within a thousandth of the lowest cost has reached it."""


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=50)
    parser.add_argument("--sqp-starts", type=int, default=50)
    wanted = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        tests = rig.run("hoist", seed=1, perturb=0.1)
        campaign = Campaign.from_toml(rig.write(tests, Path(folder) / "virtual"))
    runs = campaign.select(role="fit")
    setup = load_setup("hoist")
    nominal = smooth(campaign.drive("hoist").parameters)
    staged = fit(runs, nominal, setup)
    print("| stage | unknowns | solver | starts that reach the best | evaluations | s a start |")
    print("|---|--:|---|--:|--:|--:|")
    before = nominal
    for stage, done in zip(setup.stages, staged.stages, strict=True):
        problem = stage_problem(stage, before, runs, threads=1)
        before = done.parameters
        best = done.solution.cost
        for method, count in (("trf", wanted.starts), ("slsqp", wanted.sqp_starts)):
            if not count:
                continue
            starts = list(sobol_starts(problem, count, seed=1))
            begun = time.perf_counter()
            results = solve_from(
                problem,
                starts,
                executor=Processes(),
                method=method,
                max_evaluations=300 if method == "trf" else 4000,
            )
            wall = time.perf_counter() - begun
            best = min(best, *(each.cost for each in results))
            reached = sum(each.cost <= REACHED * best for each in results)
            print(
                f"| {stage.name} | {problem.start.size} | {method} | {reached} of {count} | "
                f"{median(each.evaluations for each in results):.0f} | "
                f"{median(each.seconds for each in results):.2f} |",
                flush=True,
            )
            worst = sorted({f"{each.cost / best:.4g}" for each in results})[:12]
            print(f"<!-- {wall:.0f} s; costs over the best: {', '.join(worst)} -->", flush=True)


if __name__ == "__main__":
    main()
