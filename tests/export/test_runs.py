"""Whole runs in C against the march in Python, bit for bit, and how much of the C they reach."""

import ctypes
import re
import shutil
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pytest
from tests.export.webassembly import Page

from swashplate import Drive
from swashplate.drive import Sample
from swashplate.export import content_of, drive_sources, values_of, wasm
from swashplate.models.displacement_control import PumpOptions

H = 1.0 / 512.0
NAMES = (*Sample._fields[1:], "motor_torque", "motor_pressure_drop")
LIMITS = ("current_rate", "dead_zone", "orifice", "spool", "swash_stop", "relief")
FRICTION = {"spool_friction": 0.5, "spool_presliding": 5e-5, "dither_time": 0.6}
LINE = {"line_stiffness": 1e6, "load_inertia": 5e3, "load_torque": 2e4}
LEAKAGE = {"motor_leakage": 1e-6, "load_inertia": 5e3, "load_torque": 3e4}
RIPPLE = {"cam_ripple": 0.01, "cam_ripple_per_torque": 5e-7, "load_torque": 3e4}
LATE = {"solenoid_delay": 0.0123, "solenoid_lag": 0.015}
EVERY = {**FRICTION, **LINE, **LEAKAGE, **RIPPLE, **LATE, "solenoid_hysteresis": 0.01,
         "swash_damping": 0.02, "motor_constant": 250.0}  # fmt: skip


class Case(NamedTuple):
    """A run of the battery."""

    preset: str = "hoist"
    changes: Mapping[str, Any] = MappingProxyType({})
    forms: Mapping[str, Any] = MappingProxyType({})
    start: str = "rest"
    rate: float = 512.0
    exact: bool = False
    late: Mapping[str, Any] = MappingProxyType({})
    measured: tuple[str, ...] = ()
    level: float = 10.0

    def drive(self) -> Drive:
        drive = Drive.preset(self.preset).replace(**self.changes)
        drive = Drive(replace(drive.parameters, **self.forms))
        # the recursion is for one rate alone
        drive = drive.at_every_rate() if self.exact or self.rate != 512.0 else drive
        return drive.replace(**self.late)

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
    Case(changes={"Z15": 2e5}, start="steady"), Case(changes={"Z9": 3e5}),
    Case(changes={"Z13": 1.2, "Z3": 0.06, "Z1": 4.6e-6, "Z15": float("inf")}, start="steady"),
     Case(changes={"lim1": float("inf"), "a": 0.0}),
    Case(exact=True), Case(exact=True, start="steady", rate=1000.0, forms={"card_switch": "split"}),
    Case(changes={"zeta": 0.4}, exact=True), Case(changes={"zeta": 3.0, "C": 0.0}, exact=True),
    Case(changes={"zeta_plus": 1.0}, exact=True, rate=777.0),
    Case(exact=True, late={"zeta": (3.0, 0.2), "omega": (300.0, 700.0)}, start="steady"),
    Case(rate=1000.0), Case("slew", rate=2048.0, start="steady"), Case(rate=513.7),
    Case(changes=FRICTION), Case(changes=FRICTION, start="steady"),
    Case(changes={"spool_friction": 0.5, "spool_presliding": 5e-5}),
    Case(changes={"solenoid_hysteresis": 0.02}, start="steady"),
    Case(changes=LATE), Case(changes=LATE, start="steady"), Case("slew", LATE, exact=True),
    Case(changes={"solenoid_delay": 0.0004}), Case(changes={"solenoid_lag": 0.2}, start="steady"),
    Case(late=LATE, start="steady", measured=("load_torque",)),
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


def compared(
    case: Case, made: Callable[..., Any], library: Path | None = None, anew: bool = False
) -> None:
    """Every output and limit of a run, in C and in Python; constants `anew` in C, or from there."""
    drive, command = case.drive(), case.command()
    inputs = case.inputs(command.size)
    run = drive.simulate(command, case.rate, interpolation="previous", start=case.start, **inputs)
    model = made(drive, 1.0 / case.rate, library)
    if anew:
        assert model.set_step(0.5 * model.get_step()) == 0
        assert model.set_step(2.0 * model.get_step()) == 0
        assert model.update() == 0
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
        wanted = run.active(name, fine=name == "current_rate")
        assert (wanted == acts).all(), name


@pytest.mark.parametrize("case", QUICK, ids=names_of(QUICK))
def test_a_packaged_drive_has_the_bits_of_the_march(case: Case, in_c: Any) -> None:
    compared(case, in_c)


@pytest.mark.slow
@pytest.mark.parametrize("case", BATTERY, ids=names_of(BATTERY))
def test_the_battery_has_the_bits_of_the_march(case: Case, in_c: Any) -> None:
    compared(case, in_c, anew=True)


# --- another library of functions -----------------------------------------------------------------

SIZES = {  # of what each signal is compared with
    "current": 1.0, "shaft_speed": 1.0, "shaft_position": 1.0, "swash_angle": 0.1,
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("start", ["rest", "steady"])
@pytest.mark.parametrize(
    "changes",
    [{}, {"omega": (60.0, 48.0), "zeta": 0.9, "a": 15.0}, {"Z13": (0.2, 0.25)},
     {**EVERY, "tau": 0.02}],
    ids=["plain", "filter", "stops", "every"],
)  # fmt: skip
def test_another_library_of_functions_gives_the_same_to_1e_12(
    changes: dict[str, Any], start: str, tmp_path: Path
) -> None:
    """WebAssembly's own `exp`, `tan`, `sin`: values set there, so that it computes constants."""
    base, command = Drive.preset("hoist").at_every_rate(), Case().command()
    drive = base.replace(**changes)
    page = Page(wasm(base, tmp_path / "a.wasm"))
    content = content_of(drive, H)
    for number, (_, _, name) in enumerate(content.exported.named("parameters")):
        if name in drive.parameters.numbers:
            assert page.call("set", number, min(drive.parameters.numbers[name], 1e30)) == 0
    assert page.call("update") == 0
    places = [content.exported.names.index(name) for name in SIZES]
    found = page.run([command], H, places, int(start == "steady"))
    run = drive.simulate(command, interpolation="previous", start=start)
    for (name, size), values in zip(SIZES.items(), found, strict=True):
        wanted = getattr(run, name)
        assert np.ptp(wanted) > 0.1 * size
        np.testing.assert_allclose(values, wanted, rtol=0.0, atol=1e-12 * np.abs(wanted).max())
        if not changes and start == "rest":
            assert (values == wanted).all()


# --- how much of the C the battery reaches --------------------------------------------------------

DUMP = "void __gcov_dump(void);\nvoid dump(void);\nvoid dump(void) { __gcov_dump(); }\n"


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("gcov") is None, reason="there is no gcov here")
def test_the_battery_reaches_every_line_and_nearly_every_branch(
    compiled: Any, in_c: Any, hoist: Drive
) -> None:
    flags = ["-O0", "--coverage"]
    library: Path = compiled({**drive_sources(), "dump.c": DUMP}, flags, strict="-std=c99")
    for case in (*QUICK, *BATTERY):
        compared(case, in_c, library, anew=True)
    whole_interface(in_c(hoist, H, library))
    ctypes.CDLL(str(library)).dump()
    (data,) = library.parent.glob("*swashplate_drive.gcda")
    done = subprocess.run(
        ["gcov", "-b", "-c", "-o", data.name, "swashplate_drive.c"],
        cwd=library.parent, capture_output=True, text=True, check=True,
    )  # fmt: skip
    text = (library.parent / "swashplate_drive.c.gcov").read_text("utf-8")
    missed = [line for line in text.splitlines() if line.lstrip().startswith("#####")]
    assert not missed, "\n".join(missed)
    said = done.stdout.split("swashplate_drive.c'")[1]
    taken = re.search(r"Taken at least once:([\d.]+)% of (\d+)", said)
    assert taken is not None
    assert int(taken[2]) > 300
    assert float(taken[1]) >= 95.0, said


def whole_interface(model: Any) -> None:
    """Every function of the interface, with what it takes and with what it does not."""
    for number in range(-1, 100):
        model.set(number, model.get(number))
        model.set(number, float("nan"))
        model.output(number)
        model.set_input(number, 1.0)
        model.set_input(number, float("nan"))
        model.set_input(number, -1e300)
        model.clear_input(number)
        model.function("sentence")(number)
        model.function("parameter_name")(number)
        model.function("output_name")(number)
        for on in (True, True, False):
            model.set_option(number, on)
            model.get_option(number)
    for kind in ("", "_output", "_input", "_option"):
        model.number(kind, "nothing")
    numbers = [
        model.number("", name) for name in ("omega_plus", "tau", "Z7", "Z12", "Z19_plus", *EVERY)
    ]
    kept = [model.get(number) for number in numbers]
    model.correct(0.0)
    model.step(1.0)
    model.set(numbers[0], 9e3)
    model.correct(1.0)
    for number, kept_value in zip(numbers, kept, strict=True):
        for value in (9e3, 9.9, 0.1, kept_value):
            model.set(number, value)
            model.settle(9.0)
            model.step(9.0)
            model.correct(9.0)
    for value in (99.0, float("nan")):
        model.step(value), model.correct(value), model.settle(value)
    for step in (0.0, 0.001, 0.001, 1.0):
        model.set_step(step)
    model.get_step(), model.limits(), model.update(), model.function("value_count")()
    model.valid()
    kept_model = bytes(model.model)
    for at in range(len(kept_model)):
        model.model[at] = b"\xff"
        model.valid()
        model.model[at] = kept_model[at : at + 1]
    values = values_of(Drive.preset("hoist"))
    for at in range(values.size):
        for bad in (float("nan"), 99.0, 1e9):
            broken = values.copy()
            broken[at] = bad
            model.init(broken)
    model.init(values, 3)
    statuses = [
        model.step(1.0), model.correct(1.0), model.settle(1.0), model.reset(), model.update(),
        model.set(0, 1.0), model.set_input(0, 1.0), model.clear_input(0),
        model.set_option(0, True), model.set_step(0.001),
    ]  # fmt: skip
    assert statuses == 10 * [5]  # SWP_NOT_READY
    assert not model.valid()
    # a search for the steady state that ends at an end of its bracket: as with leakage, and hardly
    # any supply pressure
    flags = 1 + model.number("", "solenoid_lag") + 1
    leaky, symmetric = flags + 3 + PumpOptions._fields.index("leaky"), flags + 3
    for on in (0.0, 1.0):
        values[leaky], values[symmetric], values[1 + model.number("", "Z9")] = 1.0, on, 1e3
        assert model.init(values) == 0
        for voltage in (-9.0, 9.0):
            model.settle(voltage)


MAIN = """
#include "swashplate_drive.h"
#include <stdio.h>
#include <stdlib.h>

int main(int count, char **names)
{
    swp_drive *m = malloc(swp_size()); /* on the heap, so that what lies outside is noticed */
    for (int k = 1; k < count; k++) {
        FILE *file = fopen(names[k], "rb");
        double values[200], head[3], x;
        if (file == NULL || fread(head, sizeof x, 3, file) != 3
            || fread(values, sizeof x, (size_t)head[0], file) != (size_t)head[0]
            || swp_init(m, values, (size_t)head[0]) != SWP_OK) {
            return 1;
        }
        if (head[1] > 0.0 && swp_settle(m, head[2]) != SWP_OK) {
            return 2;
        }
        double sum = 0.0;
        while (fread(&x, sizeof x, 1, file) == 1) {
            if (swp_step(m, x) != SWP_OK || swp_correct(m, x) != SWP_OK) {
                return 3;
            }
            for (int i = 0; i < SWP_OUTPUTS; i++) {
                sum += swp_output(m, i);
            }
            sum += swp_limits(m);
        }
        printf("%.17g\\n", sum);
        fclose(file);
    }
    free(m);
    return 0;
}
"""


@pytest.mark.slow
def test_sanitizers_find_nothing_in_the_battery(compiled: Any, tmp_path: Path) -> None:
    flags = ["-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    program: Path = compiled({**drive_sources(), "main.c": MAIN}, flags, "battery", "-std=c99")
    names = []
    for k, case in enumerate([*QUICK, *BATTERY]):
        values, command = values_of(case.drive(), 1.0 / case.rate), case.command()
        head = [values.size, float(case.start == "steady"), command[0]]
        names.append(str(tmp_path / f"case_{k}"))
        np.concatenate([head, values, command]).tofile(names[-1])
    done = subprocess.run([program, *names], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == len(names)
