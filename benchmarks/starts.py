"""How many random starts reach the best cost, by trust region and by SQP with differences.

    .venv/bin/python benchmarks/starts.py [--axis hoist] [--starts 50] [--sqp-starts 50]

Both fits of Kruse (2001), of the card and then of pump and motor, on a realistic virtual campaign
whose truth lies within 10 % of the published values, from Sobol points over all bounds.
docs/multi-start.md has the table and what it means.
"""

import argparse
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np
from scipy.optimize import Bounds, minimize

from swashplate import Campaign, DomainError, rig
from swashplate.executors import Processes
from swashplate.identification import Problem, fit, load_setup, sobol_starts, solve_from
from swashplate.identification.estimation import smooth
from swashplate.identification.estimation.fit_problem import problem_of

SETUPS = Path(__file__).parents[1] / "reproduction" / "setups"
REACHED = 1.001
"""A start within a thousandth of the lowest cost has reached it."""
NEAR = 2.0
"""One within twice the lowest cost is told apart from those that are lost."""
DIFFERENCES = 3000
"""Evaluations that SQP may take: about 100 gradients by differences."""


class Ended(NamedTuple):
    """How a search by SQP ended."""

    cost: float
    evaluations: int


def by_sqp(problem: Problem, start: np.ndarray) -> Ended:
    """Search as Kruse (2001) did it: sequential quadratic programming, gradients by differences."""
    best, evaluations = np.inf, 0
    unit = problem.cost(start) or 1.0

    def cost(vector: np.ndarray) -> float:
        nonlocal best, evaluations
        if evaluations >= DIFFERENCES:
            raise StopIteration
        evaluations += 1
        try:
            value = problem.cost(vector)
        except DomainError:
            return 1e6
        best = min(best, value)
        return value / unit

    with suppress(StopIteration):
        # SLSQP takes numbers of the order of 1 for granted, in its steps and in where it stops
        options = {"maxiter": DIFFERENCES, "ftol": 1e-16}
        bounds = Bounds(*problem.bounds, keep_feasible=True)
        minimize(cost, start, method="SLSQP", bounds=bounds, options=options)
    return Ended(best, evaluations)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--axis", default="hoist", choices=["hoist", "slew", "luff"])
    parser.add_argument("--starts", type=int, default=50)
    parser.add_argument("--sqp-starts", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    wanted = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        tests = rig.run(wanted.axis, seed=1, perturb=0.1)
        campaign = Campaign.from_toml(rig.write(tests, Path(folder) / "virtual"))
    runs = campaign.select(role="fit")
    before = smooth(campaign.drive(wanted.axis).parameters)
    print("| axis | part | unknowns | solver | reach the best | within twice | evaluations |")
    print("|---|---|--:|---|--:|--:|--:|")
    for part in ("card", "pump"):
        setup = load_setup(SETUPS / f"{wanted.axis}-{part}.toml")
        done = fit(before, runs, setup)
        problem = problem_of(setup, before, runs, threads=1)
        before = done.parameters
        best = done.solution.cost
        for method, count in (("trf", wanted.starts), ("slsqp", wanted.sqp_starts)):
            if not count:
                continue
            starts = list(sobol_starts(problem, count, wanted.seed))
            begun = time.perf_counter()
            if method == "trf":
                results = solve_from(problem, starts, executor=Processes(), max_evaluations=300)
            else:
                results = [each for _, each in Processes().run(by_sqp, problem, starts)]
            wall = time.perf_counter() - begun
            best = min(best, *(each.cost for each in results))
            reached, near = (
                sum(each.cost <= factor * best for each in results) for factor in (REACHED, NEAR)
            )
            print(
                f"| {wanted.axis} | {part} | {problem.start.size} | {method} | "
                f"{reached} of {count} | {near} | "
                f"{median(each.evaluations for each in results):.0f} |",
                flush=True,
            )
            worst = sorted({each.cost / best for each in results}, reverse=True)[:12]
            print(
                f"<!-- {wall:.0f} s; highest costs over the best: "
                f"{', '.join(f'{each:.4g}' for each in worst)} -->",
                flush=True,
            )


if __name__ == "__main__":
    main()
