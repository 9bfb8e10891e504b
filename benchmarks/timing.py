"""Medians of wall time, in turns with what is compared."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from statistics import median
from time import perf_counter, process_time
from typing import NamedTuple

Run = Callable[[], object]


class Timing(NamedTuple):
    """What interleaved runs gave."""

    seconds: float
    """Median of the timed runs."""
    base: float
    """Median of the runs of what it is compared with, between them."""
    ratio: float
    """Median over the rounds of the base's time over the run's."""


def seconds(run: Run) -> float:
    """Wall time of one run. [s]"""
    begin = perf_counter()
    run()
    return perf_counter() - begin


def in_turns(base: Run, run: Run, rounds: int, base_calls: int = 1) -> Timing:
    """Time a run and its base in turns: A B A B.

    The ratio is taken within each round, then the median of all rounds: a machine that slows down
    for a while slows both.

    Parameters
    ----------
    base, run : callable
        What is compared with, and what is timed. Both run once before, untimed.
    rounds : int
        Number of pairs.
    base_calls : int
        Runs of the base a round, of which the median counts; more than one beside a long run.
    """
    base()
    run()
    pairs = []
    for _ in range(rounds):
        of_base = median(seconds(base) for _ in range(base_calls))
        pairs.append((of_base, seconds(run)))
    return Timing(
        median(each[1] for each in pairs),
        median(each[0] for each in pairs),
        median(each[0] / each[1] for each in pairs),
    )


def alone(run: Run, rounds: int) -> float:
    """Median wall time of a run that is compared with nothing. [s]"""
    return median(seconds(run) for _ in range(rounds))


def cores_used(run: Run, rounds: int) -> float:
    """Median of processor time over wall time: how many cores a run was really given."""
    shares = []
    for _ in range(rounds):
        wall, processor = perf_counter(), process_time()
        run()
        shares.append((process_time() - processor) / (perf_counter() - wall))
    return median(shares)


@contextmanager
def one_core() -> Iterator[None]:
    """Keep this process, and threads that it starts, on one core (Linux)."""
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(allowed)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)
