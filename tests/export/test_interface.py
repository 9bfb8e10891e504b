"""The C interface: refusals, copies of a state, changes on the way, a provisional command."""

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.marks import rest_slow

from swashplate import Drive, InputError
from swashplate.drive import Sample
from swashplate.export import content_of, drive_sources, libraries, values_of
from swashplate.export.c_source import feedthrough
from swashplate.machine.model import state_paths

OK, BAD_VALUE, UNSTABLE, BAD_DELAY, DOMAIN, NOT_READY = range(6)
H = 1.0 / 512.0
NAMES = Sample._fields[1:]
N = np.arange(1200)
COMMAND = np.clip(8.0 * np.sin(N / 60.0) + 3.0 * np.sign(np.sin(N / 17.0)), -10.0, 10.0)


def outputs(model: Any) -> list[float]:
    return [model.output(model.number("_output", name)) for name in NAMES]


# --- refusals -------------------------------------------------------------------------------------


@pytest.mark.slow
def test_what_is_refused_leaves_the_drive_as_it_was(hoist: Drive, in_c: Any) -> None:
    model, values = in_c(hoist), values_of(hoist)
    for value in (4.0, 5.0, 6.0):
        model.step(value)
    before = bytes(model.model)
    for call in (model.step, model.correct, model.settle):
        for voltage in (float("nan"), float("-inf"), 10.5):
            assert call(voltage) == BAD_VALUE
    for name, bad in (("Z10", 0.0), ("tau", 10.0), ("Z13_plus", 2.0), ("zeta_plus", float("nan"))):
        assert model.set(model.number("", name), bad) == BAD_VALUE, name
    beyond = 1 + model.number("", "solenoid_lag")  # The last of the parameters.
    assert model.set(-1, 1.0) == model.set(beyond, 1.0) == BAD_VALUE
    assert model.set_input(3, 1.0) == model.set_input(0, float("nan")) == BAD_VALUE
    assert model.clear_input(-1) == model.set_option(99, True) == BAD_VALUE
    assert bytes(model.model) == before
    assert model.init(values, values.size - 1) == BAD_VALUE
    late = values.copy()
    late[1 + model.number("", "tau")] = 2.5
    assert model.init(late) == BAD_DELAY
    assert len({model.function("sentence")(status) for status in range(-1, 7)}) == 7


def test_a_step_that_the_filter_does_not_bear_is_said(hoist: Drive, in_c: Any) -> None:
    model = in_c(hoist)
    omega = model.number("", "omega_minus")
    zeta = hoist.parameters.numbers["zeta_minus"]
    good = model.get(omega)
    assert model.set(omega, 2.0 * zeta / H) == OK
    assert model.update() == UNSTABLE
    assert model.step(1.0) == UNSTABLE
    assert model.set(omega, good) == OK
    assert model.correct(1.0) == NOT_READY  # there was no sample
    assert model.step(1.0) == OK
    assert model.set(omega, 2.0 * zeta / H) == OK
    assert model.correct(1.0) == UNSTABLE
    assert model.settle(1.0) == UNSTABLE
    for step in (0.0, -1.0, float("nan"), 1.0 / 511.0):
        assert model.set_step(step) == BAD_VALUE
    assert model.get_step() == H
    with pytest.raises(InputError, match=r"1/512"):
        values_of(hoist, 0.01)


def test_a_domain_that_is_left_is_said_and_a_reset_heals_and_keeps_values(
    hoist: Drive, in_c: Any
) -> None:
    model = in_c(hoist)
    force = model.number("", "Z19_plus")
    was = model.get(force)
    assert model.set(force, 1e4 * was) == OK
    assert DOMAIN in [model.step(10.0) for _ in range(300)]
    assert model.settle(10.0) in (OK, DOMAIN)
    assert model.set(force, was) == model.set(model.number("", "Z16_plus"), 5e-5) == OK
    assert model.reset() == OK
    fresh = in_c(hoist.replace(Z16_plus=5e-5))
    assert (
        model.run(COMMAND, NAMES)["shaft_speed"] == fresh.run(COMMAND, NAMES)["shaft_speed"]
    ).all()


def test_outputs_that_overflow_are_said(hoist: Drive, in_c: Any) -> None:
    model = in_c(Drive(hoist.parameters.with_numbers({"Z10": 1e308})))
    assert [model.step(9.0) for _ in range(5)] == [OK] * 5
    assert model.set_input(model.number("_input", "pump_speed"), 10.0) == OK
    assert model.step(9.0) == DOMAIN


def failed_inits(hoist: Drive, model: Any) -> dict[int, np.ndarray]:
    """Values that an initialisation refuses, and what it returns for them."""
    values = values_of(hoist)
    late, unstable, no_number = values.copy(), values.copy(), values.copy()
    late[1 + model.number("", "tau")] = 5.0
    unstable[1 + model.number("", "omega_plus")] = 1500.0
    no_number[1 + model.number("", "Z5")] = np.nan
    return {BAD_DELAY: late, UNSTABLE: unstable, BAD_VALUE: no_number}


@pytest.mark.parametrize("status", [BAD_DELAY, UNSTABLE, BAD_VALUE, None])
def test_nothing_runs_before_an_initialisation_has_succeeded(
    hoist: Drive, in_c: Any, status: int | None
) -> None:
    model = in_c(hoist)
    if status is None:  # memory that nobody has initialised
        model.model.raw = bytes([0x3C]) * len(model.model.raw)
    else:
        assert model.init(failed_inits(hoist, model)[status]) == status
    assert not model.valid()
    before = bytes(model.model)
    for call in (model.step, model.correct, model.settle):
        assert call(1.0) == NOT_READY
    assert model.reset() == model.update() == model.set_step(0.001) == NOT_READY
    assert model.set(0, 1.0) == model.set_option(0, True) == NOT_READY
    assert model.set_input(0, 1.0) == model.clear_input(0) == NOT_READY
    assert bytes(model.model) == before
    assert model.init(values_of(hoist)) == OK
    assert model.step(9.0) == OK


def test_outputs_are_zero_before_the_first_sample(hoist: Drive, in_c: Any) -> None:
    model = in_c(hoist)
    assert outputs(model) == [0.0] * len(NAMES)
    model.run(COMMAND[:300], NAMES)
    assert any(outputs(model))
    assert model.limits()
    assert model.reset() == OK
    assert outputs(model) == [0.0] * len(NAMES)
    assert model.limits() == 0


# --- terms that come on ---------------------------------------------------------------------------


TERMS: dict[str, dict[str, float]] = {
    "damping": {"swash_damping": 0.05},
    "line": {"load_inertia": 5e3, "line_stiffness": 1e6},
    "line after friction": {"spool_friction": 0.1, "load_inertia": 5e3, "line_stiffness": 1e6},
    "hysteresis": {"solenoid_hysteresis": 0.005},
    "lateness": {"solenoid_delay": 0.04, "solenoid_lag": 0.2},
    "friction": {"spool_friction": 0.1},
    "leakage": {"Z7": 1e-6},
}


@pytest.mark.parametrize("changes", TERMS.values(), ids=TERMS)
def test_a_term_that_comes_on_finds_the_drive_where_it_is(
    hoist: Drive, in_c: Any, changes: dict[str, float]
) -> None:
    """The speed of a drive that has settled stays within 1 % when the term comes on."""
    model = in_c(hoist)
    speed = model.number("_output", "shaft_speed")
    for _ in range(1500):
        assert model.step(5.0) == OK
    settled = model.output(speed)
    for name, value in changes.items():
        assert model.set(model.number("", name), value) == OK
        assert model.step(5.0) == OK
        assert model.output(speed) == pytest.approx(settled, rel=0.01), name
    for _ in range(100):
        assert model.step(5.0) == OK
        assert model.output(speed) == pytest.approx(settled, rel=0.01)


TRAPPED = """
#define _GNU_SOURCE
#include <fenv.h>
#include "swashplate_drive.h"
static swp_drive drive;
static const double values[] = {VALUES};
int main(void)
{
    feenableexcept(FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW);
    int status = swp_init(&drive, values, sizeof values / sizeof values[0]);
    status |= swp_set(&drive, SWP_PARAMETER_Z8, 1.05 * swp_get(&drive, SWP_PARAMETER_Z8));
    for (int n = 0; n < 1000; n++) {
        status |= swp_step(&drive, n < 500 ? 9.0 : -9.0);
    }
    return status;
}
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="feenableexcept is glibc's")
def test_a_valid_run_raises_no_floating_point_exception(
    hoist: Drive, compiled: Callable[..., Path]
) -> None:
    """Some controllers stop a task at a division by zero, even if nobody uses what it gives."""
    values = ", ".join(
        repr(value).replace("inf", "1.0 / 0.0") for value in values_of(hoist).tolist()
    )
    program = TRAPPED.replace("VALUES", values)
    strict = "-std=c99 -O2 -ffp-contract=off"
    sources = {**drive_sources(), "trapped.c": program}
    run = subprocess.run([str(compiled(sources, (), "trapped", strict))], check=False)
    assert run.returncode == 0


# --- state ----------------------------------------------------------------------------------------


def test_a_copy_with_a_place_or_a_flag_that_cannot_be_is_not_valid(hoist: Drive, in_c: Any) -> None:
    """Any bit of the places and flags behind the delay line: valid ones go on without harm."""
    model = in_c(hoist)
    model.run(COMMAND[:50], NAMES)
    good = bytes(model.model)
    assert model.valid()
    refused = 0
    for bit in range(8 * (len(good) - 16), 8 * len(good)):  # newest, stale, settled
        wrong = bytearray(good)
        wrong[bit // 8] ^= 1 << bit % 8
        model.model.raw = bytes(wrong)
        if model.valid():
            model.step(1.0)
        else:
            refused += 1
    assert (
        refused >= 22 + 14
    )  # of a place up to 1,023 all bits above the tenth, of flags all but one


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        {"Z16_plus": 6e-5, "omega_plus": 40.0, "lim1_plus": 1.0, "a_plus": 9.0},
        {"Z7": 0.3, "Z13_plus": 0.5, "Z13_minus": 0.45, "cam_ripple": 0.01},
    ],
    ids=["values", "options"],
)
def test_a_parameter_changed_on_the_way_is_a_stepper_that_goes_on(
    hoist: Drive, in_c: Any, changes: dict[str, float]
) -> None:
    model, stepper = in_c(hoist), hoist.stepper(interpolation="previous")
    for voltage in COMMAND[:600].tolist():
        last = stepper.step(voltage)
        assert model.step(voltage) == OK
    after = hoist.replace(**changes).stepper(interpolation="previous")
    for name, value in changes.items():
        assert model.set(model.number("", name), value) == OK
    state = stepper.state
    paths = state_paths(hoist.model)
    # the C keeps what terms that are off would need, Python only what its equations read
    for path, value in {"pump.speed": last.shaft_speed, "pump.initialised": 1.0}.items():
        state.context.states[paths.index(path)] = value
    after.state = state
    for voltage in COMMAND[600:].tolist():
        sample = after.step(voltage)
        assert model.step(voltage) == OK
        assert outputs(model) == list(sample[1:])


def test_a_value_set_to_what_it_is_recomputes_nothing(hoist: Drive, in_c: Any) -> None:
    """The constants that Python computed are kept, whatever the library's `exp` is."""
    model = in_c(hoist)
    before = bytes(model.model)
    for name in hoist.parameters.numbers:
        number = model.number("", name)
        assert model.set(number, model.get(number)) == OK
    assert model.set_step(H) == OK
    assert model.set_option(0, model.get_option(0)) == OK
    assert bytes(model.model) == before


# --- a provisional command ------------------------------------------------------------------------


@pytest.mark.parametrize("tau", [0.0, 0.4 * H, 0.014])
@pytest.mark.parametrize("start", ["rest", "steady"])
def test_a_corrected_sample_is_as_if_the_command_had_been_known(
    hoist: Drive, in_c: Any, tau: float, start: str
) -> None:
    drive = hoist.replace(tau=tau, load_inertia=5e3, motor_leakage=1e-6)
    known, late = in_c(drive), in_c(drive)
    torque = known.number("_input", "load_torque")
    loads = 2e4 * np.cos(N / 30.0)
    for model in (known, late):
        assert model.set_input(torque, float(loads[0])) == OK
        if start == "steady":
            assert model.settle(float(COMMAND[0])) == OK
    guess = 0.0
    for voltage, load in zip(COMMAND.tolist(), loads.tolist(), strict=True):
        assert known.set_input(torque, load) == OK
        assert known.step(voltage) == OK
        assert late.step(guess) == OK
        if tau > 1.5 * H and guess == voltage:
            assert outputs(late)[:4] == outputs(known)[:4]
        assert late.set_input(torque, load) == OK
        assert late.correct(voltage) == OK
        assert outputs(late) == outputs(known)
        guess = voltage


def test_inputs_set_and_cleared(hoist: Drive, in_c: Any) -> None:
    model, plain = in_c(hoist), in_c(hoist)
    speed = model.number("_input", "pump_speed")
    assert model.set_input(speed, 0.5) == OK
    model.run(COMMAND[:300], NAMES)
    plain.run(COMMAND[:300], NAMES)
    assert outputs(model) != outputs(plain)
    # what no prime mover and no supply has is refused, and nothing changes
    supply = model.number("_input", "supply_pressure")
    assert model.set_input(speed, 0.0) == OK
    assert model.set_input(speed, -0.1) == BAD_VALUE
    assert model.set_input(supply, 0.0) == BAD_VALUE
    assert model.set_input(supply, -5e6) == BAD_VALUE
    assert model.set_input(supply, 1e10) == model.set_input(speed, 1800.0) == BAD_VALUE
    assert model.clear_input(speed) == OK
    one, two = model.run(COMMAND[300:], NAMES), plain.run(COMMAND[300:], NAMES)
    assert (one["shaft_speed"] == two["shaft_speed"]).all()


LOAD = {"load_inertia": 5e3, "motor_constant": 250.0, "load_torque": 1e4}
FREE = {"lim1": float("inf"), "lim2": float("inf"), "a": float("inf")}
FORMS: dict[str, dict[str, float]] = {
    "plain": LOAD,
    "acceleration": {**LOAD, "Z12": 0.1},
    "leaky motor": {**LOAD, "motor_leakage": 1e-6},
    "line": {**LOAD, "line_stiffness": 1e6},
    "ripple": {**LOAD, "cam_ripple": 0.01, "cam_ripple_per_torque": 5e-7},
    "late": {**LOAD, **FREE, "tau": 1.2 * H},
    "no delay": {**LOAD, **FREE, "tau": 0.0, "Z12": 0.1},
}


@pytest.mark.parametrize("changes", FORMS.values(), ids=FORMS)
def test_feedthrough_is_what_a_jump_of_an_input_moves_at_once(
    in_c: Any, changes: dict[str, float]
) -> None:
    """Of the form that is exported: what moves is declared, and what is declared can move."""
    drive = Drive.preset("hoist").replace(**changes)
    content = content_of(drive, H)
    said = feedthrough(content.exported, content.machine, H)
    jumps = {"load_torque": 3e4, "pump_speed": 1.2, "supply_pressure": 1.2e7}
    moved: dict[str, set[str]] = {name: set() for name in said}
    model = in_c(drive)
    places = [model.number("_output", name) for name in said]
    for n, voltage in enumerate(COMMAND[:420].tolist()):
        if n % 7 == 6:
            before = bytes(model.model)
            assert model.step(5.0) == OK
            plain = [model.output(place) for place in places]
            for signal, value in (*jumps.items(), ("voltage", 0.0), ("voltage", -5.0)):
                model.model.raw = before
                if signal != "voltage":
                    assert model.set_input(model.number("_input", signal), value) == OK
                assert model.step(value if signal == "voltage" else 5.0) == OK
                for name, place, known in zip(said, places, plain, strict=True):
                    if model.output(place) != known:
                        moved[name].add(signal)
            model.model.raw = before
        assert model.step(voltage) == OK
    assert moved == {name: set(inputs) for name, inputs in said.items()}


# --- size -----------------------------------------------------------------------------------------


def test_a_state_is_small(hoist: Drive, in_c: Any, compiled: Callable[..., Path]) -> None:
    assert in_c(hoist).function("size")() <= 18_000
    short = compiled(drive_sources(), ["-DSWP_LINE=64"])
    model = in_c(hoist, H, short)
    assert model.function("size")() <= 2_600
    run = hoist.simulate(COMMAND, 512.0, interpolation="previous")
    assert (model.run(COMMAND, ["shaft_speed"])["shaft_speed"] == run.shaft_speed).all()


@pytest.mark.slow
def test_a_controller_has_room_for_the_equations(tmp_path: Path) -> None:
    """An object for a Cortex-M7 with double precision."""
    if not libraries.has_zig() or not shutil.which("size"):
        pytest.skip("ziglang is not installed")
    libraries.written(drive_sources(), tmp_path)
    machine = ["-target", "thumb-linux-musleabihf", "-mcpu=cortex_m7+fp_armv8d16"]
    flags = ["-Os", "-g0", "-ffp-contract=off", "-fno-math-errno", "-fno-unwind-tables"]
    command = [sys.executable, "-m", "ziglang", "cc", *machine, *flags, "-c", "swashplate_drive.c"]
    subprocess.run([*command, "-o", "drive.o"], cwd=tmp_path, check=True)
    said = subprocess.run(
        ["size", "drive.o"], cwd=tmp_path, capture_output=True, text=True, check=True
    ).stdout
    assert int(said.splitlines()[1].split()[3]) <= 16_000


@pytest.mark.slow
def test_fast_mathematics_does_not_compile(compiled: Callable[..., Path]) -> None:
    with pytest.raises(AssertionError, match="fast-math"):
        compiled(drive_sources(), ["-ffast-math"])


@pytest.mark.parametrize("flags", rest_slow(["-O0", "-O3", "-O3 -march=native -fno-math-errno"]))
def test_other_flags_leave_the_bits_alone(
    hoist: Drive, in_c: Any, compiled: Callable[..., Path], flags: str
) -> None:
    model = in_c(hoist, H, compiled(drive_sources(), flags.split()))
    found = model.run(COMMAND, NAMES)
    run = hoist.simulate(COMMAND, 512.0, interpolation="previous")
    for name in NAMES:
        assert (found[name] == getattr(run, name)).all(), name
