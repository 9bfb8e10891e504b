"""Whole runs in C against the march in Python, bit for bit, and how much of the C they reach."""

import ctypes
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from swashplate import DomainError, Drive, InputError
from swashplate.export import drive_sources, values_of
from swashplate.simulation.stepper import Sample

H = 1.0 / 512.0
NAMES = (*Sample._fields[1:], "motor_torque", "motor_pressure_drop")
LIMITS = ("current_rate", "dead_zone", "orifice", "spool", "swash_stop", "relief")
FRICTION = {"spool_friction": 0.5, "spool_presliding": 5e-5, "dither_time": 0.6}
LINE = {"line_stiffness": 1e6, "load_inertia": 5e3, "load_torque": 2e4}
LEAKAGE = {"motor_leakage": 1e-6, "load_inertia": 5e3, "load_torque": 3e4}
RIPPLE = {"cam_ripple": 0.01, "cam_ripple_per_torque": 5e-7, "load_torque": 3e4}
EVERY = {**FRICTION, **LINE, **LEAKAGE, **RIPPLE, "solenoid_hysteresis": 0.01,
         "swash_damping": 0.02, "motor_constant": 250.0}  # fmt: skip


class Case(NamedTuple):
    """A run of the battery."""

    preset: str = "hoist"
    changes: dict[str, Any] = {}
    forms: dict[str, Any] = {}
    start: str = "rest"
    rate: float = 512.0
    exact: bool = False
    measured: tuple[str, ...] = ()
    level: float = 10.0

    def drive(self) -> Drive:
        drive = Drive.preset(self.preset).replace(**self.changes)
        drive = Drive(replace(drive.parameters, **self.forms))
        return drive.at_every_rate() if self.exact else drive

    def command(self, size: int = 2500) -> np.ndarray:
        """Steps, pauses, sines and noise over all of the range."""
        rng = np.random.default_rng(len(repr(self)))
        n = np.arange(size)
        sines = 0.6 * np.sin(n / 41.0) + 0.4 * np.sin(n / 7.3 + 1.0)
        steps = rng.choice([0.0, 0.0, 1.0, -1.0, 0.2], size // 250 + 1)[n // 250]
        made = np.where(n % 1000 < 500, steps, sines + 0.1 * rng.standard_normal(size))
        return np.clip(self.level * made, -10.0, 10.0)

    def inputs(self, size: int) -> dict[str, np.ndarray]:
        n = np.arange(size)
        every = {
            "load_torque": 3e4 * np.sin(n / 90.0),
            "pump_speed": 1.0 + 0.1 * np.sin(n / 70.0),
            "supply_pressure": 2.0e6 + 3e5 * np.cos(n / 50.0),
        }
        return {name: every[name] for name in self.measured}


QUICK = [
    *(Case(name, start=start) for name in ("hoist", "slew", "luff", "neutral")
      for start in ("rest", "steady")),
]  # fmt: skip
BATTERY = [
    *(Case(name, {"tau": tau}, start=start) for name in ("hoist", "slew", "luff", "neutral")
      for tau in (0.0, 0.4 * H, 0.03) for start in ("rest", "steady")),
    *(Case(name, forms={form: value}, start="steady") for name in ("hoist", "slew")
      for form, value in (("coulomb_sign", "literal"), ("card_switch", "split"),
                          ("pressure_root", "symmetric"))),
    Case(changes={"Z7": 0.3}), Case(changes={"Z7": 0.3}, start="steady"),
    Case("slew", {"Z12": 0.2}), Case(changes={"Z13": 0.5, "Z15": float("inf")}, start="steady"),
    Case(changes={"Z13": (0.45, 0.1)}), Case(changes={"Z14": 1e-4, "Z16": 2e-4}),
    Case(changes={"Z15": 3e5}, start="steady"), Case(changes={"lim1": float("inf"), "a": 0.0}),
    Case(exact=True), Case(exact=True, start="steady", rate=1000.0, forms={"card_switch": "split"}),
    Case(changes={"zeta": 0.4}, exact=True), Case(changes={"zeta": 3.0, "C": 0.0}, exact=True),
    Case(changes={"zeta_plus": 1.0}, exact=True, rate=777.0),
    Case(rate=1000.0), Case("slew", rate=2048.0, start="steady"), Case(rate=513.7),
    Case(changes=FRICTION), Case(changes=FRICTION, start="steady"),
    Case(changes={"spool_friction": 0.5, "spool_presliding": 5e-5}),
    Case(changes={"solenoid_hysteresis": 0.02}, start="steady"),
    Case(changes=RIPPLE), Case(changes={"swash_damping": 0.02}, start="steady"),
    Case(changes=LEAKAGE, start="steady"), Case(changes=LINE, start="steady"),
    Case(changes=LINE, measured=("load_torque",)),
    Case(changes=EVERY), Case(changes={**EVERY, "Z7": 0.2, "Z12": 0.1, "Z13": 0.5}, exact=True),
    Case(changes=EVERY, measured=("load_torque", "pump_speed", "supply_pressure")),
    Case(measured=("load_torque", "pump_speed", "supply_pressure"), start="steady"),
    Case("neutral", measured=("pump_speed",), level=1.5),
    Case("luff", changes={"Z7": 0.3, "Z12": 0.2}, forms={"pressure_root": "symmetric"}),
]  # fmt: skip


def names_of(cases: list[Case]) -> list[str]:
    """What is special about each case, in words."""
    return [re.sub(r"[^\w.,=]+", "", ",".join(f"{k}={v}" for k, v in each._asdict().items()
            if v != Case._field_defaults[k])) or "hoist" for each in cases]  # fmt: skip


def compared(case: Case, made: Callable[..., Any], library: Path | None = None) -> None:
    """Every output and limit of a run, in C and in Python."""
    drive, command = case.drive(), case.command()
    inputs = case.inputs(command.size)
    run = drive.simulate(
        command, case.rate, interpolation="previous", start=case.start, **inputs
    )  # type: ignore[arg-type]
    model = made(drive, 1.0 / case.rate, library)
    numbers = {name: model.number("_input", name) for name in inputs}

    def feed(n: int) -> None:
        for name, values in inputs.items():
            assert model.set_input(numbers[name], float(values[n])) == 0

    feed(0)
    if case.start == "steady":
        assert model.settle(float(command[0])) == 0
    places = [model.number("_output", name) for name in NAMES]
    out, flags = np.empty((command.size, len(NAMES))), np.empty(command.size, dtype=np.int64)
    for n, value in enumerate(command.tolist()):
        feed(n)
        assert model.step(value) == 0, n
        out[n] = [model.output(place) for place in places]
        flags[n] = model.limits()
    for name, values in zip(NAMES, out.T, strict=True):
        wanted = getattr(run, name)
        if wanted is None:  # without the motor's constant, 0 in C
            wanted = np.zeros(command.size)
        assert (wanted == values).all(), (name, np.abs(wanted - values).max())
    for bit, name in enumerate(LIMITS):
        acts = ((flags >> bit) & 1).astype(bool)
        wanted = run.rate_limited() if name == "current_rate" else run.active(name)
        assert (wanted == acts).all(), name


@pytest.mark.parametrize("case", QUICK, ids=names_of(QUICK))
def test_a_packaged_drive_has_the_bits_of_the_march(case: Case, in_c: Any) -> None:
    compared(case, in_c)


@pytest.mark.slow
@pytest.mark.parametrize("case", BATTERY, ids=names_of(BATTERY))
def test_the_battery_has_the_bits_of_the_march(case: Case, in_c: Any) -> None:
    compared(case, in_c)
