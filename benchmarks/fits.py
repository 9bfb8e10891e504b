"""Rows of the table for what a fit evaluates: residuals, derivatives, triangular factors."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from cases import RATE, STEP
from numpy.typing import NDArray
from reference import Reference
from table import Row, duration, times
from timing import Timing, in_turns, one_core

from swashplate import Drive
from swashplate.drive import ALL_COLUMNS, PUMP_COLUMNS, bound_drive
from swashplate.machine.marching import Observation, ObservedRecord, record_of
from swashplate.maneuvers import source_tests
from swashplate.parameters import DEFINITIONS

Array = NDArray[np.float64]

ROUNDS = 40
PUMP = tuple(name for name in PUMP_COLUMNS if name != "Z12")
"""Kruse's 27 parameters of pump and motor."""
CARD = tuple(name for name in ALL_COLUMNS if name not in PUMP_COLUMNS and name != "tau")
FREE = tuple(
    DEFINITIONS.columns_of(
        ["Z1", "Z3", "Z8", "Z10", "Z13", "Z16", "Z17", "Z19", "Z20", "Z21", "Z22"]
    )
)
"""What is left of them without gauges and without what no test reaches."""


class HoistTests:
    """Kruse's 13 tests of the hoist, with speed and current observed at every sample."""

    def __init__(self) -> None:
        self.drive = Drive.preset("hoist")
        self.reference = Reference(self.drive.parameters.numbers)
        runs = [test.sample(RATE) for test in source_tests("hoist").values()]
        found = [self.drive.simulate(voltage) for voltage in runs]
        self.currents = [np.array(each.current) for each in found]
        self.speeds = [np.empty(each.size) for each in self.currents]
        self.samples = sum(each.size for each in self.currents)
        rng = np.random.default_rng(0)
        self.pump, self.card, self.chain = [], [], []
        for voltage, run in zip(runs, found, strict=True):
            noise = 0.01 * rng.normal(size=run.time.size)
            speed = Observation("shaft_speed", run.time, run.shaft_speed + noise)
            read = run.current_positive + run.current_negative
            current = Observation("current_sum", run.time, read + noise)
            command = record_of(voltage, RATE, what="voltage")
            signed = record_of(run.current, RATE, what="current")
            self.pump.append(ObservedRecord(signed, [speed], driven_by="current"))
            self.card.append(ObservedRecord(command, [current]))
            self.chain.append(ObservedRecord(command, [current, speed]))
        self.kept = [np.empty((len(PUMP) + 1, each.rows)) for each in self.pump]

    def c_pump(self) -> None:
        """Speeds of all tests in C."""
        for current, speed in zip(self.currents, self.speeds, strict=True):
            self.reference.speed(current, STEP, speed)

    def residuals(self, tests: list[ObservedRecord]) -> None:
        """Residuals of all tests."""
        for each in tests:
            bound_drive(self.drive.parameters, each).residuals(each)

    def jacobian(self) -> None:
        """Residuals and derivatives of all tests, into memory from before."""
        for each, kept in zip(self.pump, self.kept, strict=True):
            bound_drive(self.drive.parameters, each, PUMP).jacobian(each, kept)

    def triangle(self, tests: list[ObservedRecord], columns: tuple[str, ...]) -> None:
        """Triangular factors of all tests."""
        for each in tests:
            bound_drive(self.drive.parameters, each, columns).triangle(each)


def fit_rows() -> Iterator[Row]:
    """One evaluation of a fit to the hoist's tests, against differences over runs of C."""
    tests = HoistTests()
    tests.c_pump()
    run = partial(in_turns, tests.c_pump, rounds=ROUNDS)
    what = f"hoist's {len(tests.pump)} tests, {tests.samples:,} samples"
    with one_core():
        yield _row(f"{what}: C, pump", run(tests.c_pump), 1)
        yield _row("... residuals, pump", run(partial(tests.residuals, tests.pump)), 1)
        found = run(tests.jacobian)
        text = f"... residuals and Jacobian, {len(PUMP)} parameters, against {len(PUMP) + 1} C runs"
        yield _row(text, found, len(PUMP) + 1, least=30.0)
        for text, observed, columns, limit in (
            ("pump", tests.pump, FREE, 0.024),
            ("pump", tests.pump, PUMP, None),
            ("card alone", tests.card, CARD, None),
            ("card and pump, speed and current", tests.chain, (*PUMP, *CARD), None),
        ):
            found = run(partial(tests.triangle, observed, columns))
            text = f"... triangular factor of {len(columns)} columns, {text}"
            yield _row(text, found, len(columns) + 1, most=limit)


def _row(
    what: str, timing: Timing, runs: int, *, least: float | None = None, most: float | None = None
) -> Row:
    """A row whose ratio refers to so many runs of C."""
    ratio = runs * timing.ratio
    said, met = "", None
    if least is not None:
        said, met = f"≥ {least:g}×", ratio >= least
    if most is not None:
        said, met = f"≤ {duration(most)}", timing.seconds <= most
    return Row(what, duration(timing.seconds), times(ratio), said, met)
