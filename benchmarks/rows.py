"""Rows of the table that are measured in this process: the march, its derivatives, batches."""

from collections.abc import Iterator
from functools import partial

import adaptive
import numpy as np
from cases import CARD_SPREAD, PUMP_SPREAD, RATE, SETS, STEP, changes
from numpy.typing import NDArray
from reference import Reference
from table import Row, duration, times
from timing import Timing, cores_used, in_turns, one_core

from swashplate import Drive, Serial, SquaredError, maneuvers
from swashplate.drive import PUMP_COLUMNS, bound_drive
from swashplate.machine.marching import Observation, ObservedRecord, SignalId, record_of
from swashplate.machine.marching.run import PlannedMarch, arrays_of

Array = NDArray[np.float64]

ROUNDS = 300


class Kernel:
    """The compiled march of a record, with everything that it reads and writes made beforehand."""

    def __init__(self, drive: Drive, signal: str, values: Array) -> None:
        self.instance = drive if signal == "voltage" else drive.by_current
        initial = self.instance.start({signal: float(values[0])}, STEP)
        self.at_rest, self.states = initial.flat, initial.flat.copy()
        kept = ((SignalId(1, "signals", "shaft_speed"), 0),)
        planned = PlannedMarch(self.instance.model, (signal,), self.instance.options, kept)
        self.march = planned()
        self.out, self.worst_margin = np.empty((1, values.size)), np.empty(1)
        self.values = (values,)
        delays = self.instance.tap_delays((signal,), STEP)
        self.arrays = arrays_of(
            self.instance,
            self.values,
            initial,
            delays,
            self.states,
            self.worst_margin,
            self.out.reshape(-1),
        )

    def __call__(self) -> Array:
        """The shaft speed from rest."""
        self.states[:], self.worst_margin[:] = self.at_rest, np.inf
        self.march(self.out.size, 0, STEP, *self.arrays)
        return self.out[0]


class Marches:
    """The hoist and its record, with everything that a kernel writes to made beforehand."""

    def __init__(self) -> None:
        self.drive = Drive.preset("hoist")
        self.reference = Reference(self.drive.parameters.numbers)
        self.voltage = maneuvers.sine(6.5, 0.1).sample(RATE)
        self.current = np.array(self.drive.simulate(self.voltage).current)
        n = self.voltage.size
        self.signed, self.speed = np.empty(n), np.empty(n)
        self.pump_kernel = Kernel(self.drive, "current", self.current)
        self.drive_kernel = Kernel(self.drive, "voltage", self.voltage)
        command = record_of(self.current, RATE, what="current")
        zeros = Observation("shaft_speed", np.arange(n) / RATE, np.zeros(n))
        self.observed = ObservedRecord(command, [zeros], driven_by="current")
        self.rows = np.empty((len(PUMP_COLUMNS) + 1, self.observed.rows))

    def c_pump(self) -> None:
        """Pump and motor in C."""
        self.reference.speed(self.current, STEP, self.speed)

    def c_drive(self) -> None:
        """Card, pump and motor in C."""
        self.reference.current(self.voltage, STEP, self.signed)
        self.reference.speed(self.signed, STEP, self.speed)

    def jacobian_call(self) -> None:
        """Speed and all its derivatives, into memory from before."""
        ready = bound_drive(self.drive.parameters, self.observed, PUMP_COLUMNS)
        ready.jacobian(self.observed, self.rows)

    def pump_call(self) -> Array:
        """Pump and motor as a user calls them."""
        return self.drive.simulate_current(self.current).shaft_speed

    def drive_call(self) -> Array:
        """Card, pump and motor as a user calls them."""
        return self.drive.simulate(self.voltage).shaft_speed

    def sensitivities_call(self) -> Array:
        """All derivatives as a user calls them."""
        return self.drive.sensitivities_current(self.current)["shaft_speed"]


def _against_c(what: str, timing: Timing, target: float | None = None) -> Row:
    met = None if target is None else timing.ratio >= target
    said = "" if target is None else f"≥ {target:g}×"
    return Row(what, duration(timing.seconds), times(timing.ratio), said, met)


def march_rows(m: Marches) -> Iterator[Row]:
    """One simulation: in C, by SciPy, by the kernels, by the public calls."""
    pump = partial(in_turns, m.c_pump, rounds=ROUNDS)
    with one_core():
        yield Row("C, pump: what the ratios refer to", duration(pump(m.c_pump).seconds), "1×")
        yield _against_c("C, card and pump", pump(m.c_drive))
        for what, longest in (("steps up to 1/512 s", STEP), ("steps of any length", np.inf)):
            pump_set = m.pump_kernel.instance.parts[1].p
            run = partial(adaptive.integrate, m.current, STEP, pump_set, longest)
            timing = in_turns(m.c_pump, run, 5, base_calls=9)
            yield _against_c(f"SciPy `solve_ivp`, pump, {what}", timing)
        yield _against_c("pump, kernels", pump(m.pump_kernel), 4.5)
        yield _against_c("pump, `simulate_current`", pump(m.pump_call), 4.5)
        yield _against_c("card and pump, kernels", pump(m.drive_kernel), 3.0)
        yield _against_c("card and pump, `simulate`", pump(m.drive_call), 3.0)


def sensitivity_rows(m: Marches) -> Iterator[Row]:
    """Derivatives by all of the pump's parameters, as multiples of a plain run."""
    for kind, base, run in (
        ("arrays made beforehand", m.pump_kernel, m.jacobian_call),
        ("`sensitivities_current`", m.pump_call, m.sensitivities_call),
    ):
        with one_core():
            timing = in_turns(base, run, ROUNDS)
        cost = 1.0 / timing.ratio
        yield Row(
            f"pump with {len(PUMP_COLUMNS)} sensitivities, {kind}",
            duration(timing.seconds),
            f"{times(cost)} plain",
            "≤ 2.5× plain",
            cost <= 2.5,
        )


def batch_rows(m: Marches) -> Iterator[Row]:
    """Many parameter sets, only the cost of each."""
    numbers = m.drive.parameters.numbers
    cost = SquaredError(m.drive_call())
    for what, symbols, record in (
        ("pump", PUMP_SPREAD, {"current": m.current}),
        ("card and pump", PUMP_SPREAD + CARD_SPREAD, {"voltage": m.voltage}),
    ):
        values = changes(numbers, symbols)
        run = partial(m.drive.simulate_many, values, cost=cost, **record)
        with one_core():
            timing = in_turns(m.c_pump, partial(run, executor=Serial()), 7, base_calls=25)
        each = Timing(timing.seconds / SETS, timing.base, timing.ratio * SETS)
        yield _against_c(f"{what}, each of {SETS:,} sets, one core", each, 10.0)
        timing = in_turns(m.c_pump, run, 15, base_calls=25)
        each = Timing(timing.seconds / SETS, timing.base, timing.ratio * SETS)
        used = cores_used(run, 15)
        yield _against_c(f"{what}, each of {SETS:,} sets, all cores ({used:.1f} given)", each)


def check(m: Marches) -> Row:
    """How far the C reference is from the package: they must compute the same."""
    m.c_pump()
    of_pump = np.rad2deg(np.abs(m.speed - m.pump_call()).max())
    m.c_drive()
    of_drive = np.rad2deg(np.abs(m.speed - m.drive_call()).max())
    worst = max(of_pump, of_drive)
    if not worst < 0.02:
        raise RuntimeError(f"The C reference is {worst:g} deg/s off: it computes something else.")
    return Row("largest difference to C", f"{worst:.1g} deg/s", "", "< 0.02 deg/s", True)
