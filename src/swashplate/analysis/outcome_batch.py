"""Outcomes of many variants of a drive, block by block, in memory that does not grow with them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from swashplate.analysis.outcomes import Outcome, outcome_matrix
from swashplate.analysis.trial import Trial
from swashplate.drive import Drive
from swashplate.equations.marching.lanes import LANES
from swashplate.executors import Serial, available_cores

Array = NDArray[np.float64]

SAMPLES_AT_ONCE = 2**20
"""Samples of speed that a block of drives holds: 8 MB, whatever the number of drives."""


@dataclass(frozen=True, eq=False)
class BatchOutcomes:
    """Outcomes of many drives over one command."""

    outcomes: tuple[Outcome, ...]
    values: Array
    """(m, K); NaN where a drive has no such outcome, and in all of a drive that failed."""
    failures: Mapping[int, str]
    """Why a drive could not be simulated, by its number."""

    def undefined(self, number: int) -> int:
        """How many of the drives that ran have no such outcome."""
        failed = np.zeros(len(self.values), dtype=bool)
        failed[list(self.failures)] = True
        return int((np.isnan(self.values[:, number]) & ~failed).sum())


def batch_outcomes(
    drive: Drive,
    columns: Mapping[str, Array],
    trial: Trial,
    outcomes: Sequence[Outcome],
    *,
    threads: int | None = None,
) -> BatchOutcomes:
    """Simulate many variants of a drive over one command and keep only their outcomes.

    Parameters
    ----------
    drive : Drive
        What is not varied.
    columns : mapping of str to (m,) array
        Values by symbol or column, one a variant, as `Drive.simulate_many` takes them. [SI]
    trial : Trial
        The command, from rest.
    outcomes : sequence of Outcome
        What to keep.
    threads : int, optional
        Blocks at once, one a core by default. The numbers do not depend on it.

    Raises
    ------
    InputError
        If the columns do not fit the drive or each other.

    Notes
    -----
    Speeds are made block by block and dropped, so that memory grows with the outcomes alone.
    """
    count = len(next(iter(columns.values())))

    def block(first: int, size: int) -> tuple[Array, dict[int, str]]:
        part = {name: values[first : first + size] for name, values in columns.items()}
        run = drive.simulate_many(part, voltage=trial.voltage, rate=trial.rate, executor=Serial())
        assert run.output is not None
        ran = np.ones(len(run.output), dtype=bool)
        ran[list(run.failures)] = False
        kept = np.full((ran.size, len(outcomes)), np.nan)
        kept[ran] = outcome_matrix(run.output[ran], trial, outcomes)
        return kept, {first + k: why for k, why in run.failures.items()}

    # whole blocks of what the batch marches side by side
    size = max(SAMPLES_AT_ONCE // trial.voltage.size // LANES * LANES, LANES)
    with ThreadPoolExecutor(threads or available_cores()) as pool:
        done = list(pool.map(partial(block, size=size), range(0, count, size)))
    return BatchOutcomes(
        tuple(outcomes),
        np.concatenate([kept for kept, _ in done]),
        {k: why for _, failures in done for k, why in failures.items()},
    )


def undefined_sentences(found: BatchOutcomes) -> Iterator[str]:
    """What some of the drives have not, and why."""
    for number, each in enumerate(found.outcomes):
        missing = found.undefined(number)
        if missing:
            yield (
                f"{missing} of {len(found.values)} variants have no {each.name}: {each.undefined}."
            )
