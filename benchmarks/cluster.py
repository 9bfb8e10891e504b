"""Many starts on a local Dask cluster that loses a worker midway: the result is the same.

    .venv/bin/python benchmarks/cluster.py

Needs the extra 'dask'. Prints the costs that were reached and how long it took; ends with an error
if a single bit differs from the starts solved one after another.
"""

import os
import signal
import tempfile
import time
from pathlib import Path

from distributed import LocalCluster

from swashplate import Campaign, rig
from swashplate.executors import Dask, Serial
from swashplate.identification import Solution, load_setup, sobol_starts, solve_from
from swashplate.identification.estimation.fit_problem import problem_of

WORKERS, STARTS = 3, 16
CARD = Path(__file__).parents[1] / "reproduction" / "setups" / "hoist-card.toml"


def main() -> None:
    """Run and compare."""
    with tempfile.TemporaryDirectory() as folder:
        tests = rig.run("hoist", seed=1, perturb=0.1)
        campaign = Campaign.from_toml(rig.write(tests, Path(folder) / "virtual"))
        runs = campaign.select(role="fit")
        problem = problem_of(load_setup(CARD), campaign.drive("hoist").parameters, runs, threads=1)
        starts = [problem.start, *sobol_starts(problem, STARTS - 1, seed=1)]
        alone = solve_from(problem, starts, executor=Serial())
        with LocalCluster(
            n_workers=WORKERS, threads_per_worker=1, dashboard_address=None
        ) as cluster:
            victim = next(iter(cluster.workers.values())).pid
            killed = False

            def watch(result: Solution, done: int) -> None:
                nonlocal killed
                if done >= 3 and not killed:
                    os.kill(victim, signal.SIGKILL)
                    killed = True

            begun = time.perf_counter()
            there = solve_from(
                problem, starts, executor=Dask(cluster.scheduler_address), watch=watch
            )
            seconds = time.perf_counter() - begun
    assert killed, "no worker was lost: nothing was shown"
    for one, other in zip(alone, there, strict=True):
        assert (one.number, one.cost) == (other.number, other.cost)
        assert (one.vector == other.vector).all()
    best = min(each.cost for each in there)
    reached = sum(each.cost < 1.0001 * best for each in there)
    print(f"{len(there)} starts on {WORKERS} workers, one of them killed: {seconds:.1f} s.")
    print(f"Equal to the last bit to those solved one by one; {reached} reached {best:.6g}.")


if __name__ == "__main__":
    main()
