"""FMUs as an importer runs them: FMPy loads the library and calls its functions."""

import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.marks import rest_slow

from swashplate import Drive, export
from swashplate.drive import Sample
from swashplate.models.drive import pump_drive

fmpy = pytest.importorskip("fmpy")
from fmpy.fmi1 import FMICallException  # noqa: E402
from fmpy.fmi2 import (  # noqa: E402
    FMU2Slave,
    defaultCallbacks,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.fmi3 import FMU3Slave  # noqa: E402

H = 1.0 / 512.0
OUTPUTS = Sample._fields[1:]
pytestmark = pytest.mark.skipif(
    fmpy.platform not in ("linux64",), reason="the references were made on Linux, x86-64"
)


class Master:
    """An importer of one FMU: variables by name, the same calls for both versions."""

    def __init__(self, folder: Path) -> None:
        self.description = fmpy.read_model_description(str(folder))
        self.by_name = {each.name: each for each in self.description.modelVariables}
        self.two = self.description.fmiVersion == "2.0"
        self.said: list[str] = []
        kind = FMU2Slave if self.two else FMU3Slave
        self.fmu: Any = kind(
            guid=self.description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="drive",
        )

    def begin(self, time: float = 0.0, **values: float) -> "Master":
        """Instantiate and initialize."""
        self.instantiate()
        self.initialize(time, **values)
        return self

    def instantiate(self) -> None:
        if not self.two:
            self.fmu.instantiate(logMessage=lambda *words: self.said.append(words[-1].decode()))
            return

        def say(environment: Any, name: Any, status: int, category: Any, message: bytes) -> None:
            self.said.append(message.decode())

        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = fmi2CallbackLoggerTYPE(say)
        self.callbacks.allocateMemory = defaultCallbacks.allocateMemory
        self.callbacks.freeMemory = defaultCallbacks.freeMemory
        self.fmu.instantiate(callbacks=self.callbacks)

    def initialize(self, time: float = 0.0, **values: float) -> None:
        if self.two:
            self.fmu.setupExperiment(startTime=time)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=time)
        self.set(**values)
        self.fmu.exitInitializationMode()

    def call(self, two: str, three: str, *arguments: Any) -> Any:
        """A function by its names in FMI 2.0 and 3.0."""
        return getattr(self.fmu, two if self.two else three)(*arguments)

    def set(self, **values: float) -> None:
        for name, value in values.items():
            variable = self.by_name[name]
            real = "setBoolean" if variable.type == "Boolean" else "setReal"
            other = "setBoolean" if variable.type == "Boolean" else "setFloat64"
            self.call(real, other, [variable.valueReference], [value])

    def read(self, references: list[int]) -> list[float]:
        return self.call("getReal", "getFloat64", references)

    def get(self, *names: str) -> list[float]:
        return self.read([self.by_name[name].valueReference for name in names])

    def step(self, time: float, interval: float) -> None:
        self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=interval)

    @property
    def state(self) -> bytes:
        """The state, serialized."""
        kept = self.call("getFMUstate", "getFMUState")
        made = self.call("serializeFMUstate", "serializeFMUState", kept)
        self.call("freeFMUstate", "freeFMUState", kept)
        return bytes(made)

    @state.setter
    def state(self, given: bytes) -> None:
        made = self.call("deSerializeFMUstate", "deserializeFMUState", given)
        self.call("setFMUstate", "setFMUState", made)

    def played(self, voltage: Any, interval: float = H, start: float = 0.0) -> np.ndarray:
        """Outputs at each communication point, each read before the voltage of its instant is set.

        The first voltage must have been set before.
        """
        made = np.empty((len(voltage), len(OUTPUTS)))
        for i, volts in enumerate(voltage):
            made[i] = self.get(*OUTPUTS)
            self.set(voltage=volts)
            self.step(start + i * interval, interval)
        return made


@pytest.fixture(params=["2.0", pytest.param("3.0", marks=pytest.mark.slow)])
def fmi(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def made(tmp_path: Path, fmi: str) -> Iterator[Callable[..., Master]]:
    """Masters of FMUs of drives, each of a file of its own."""
    masters: list[Master] = []

    def make(drive: Drive, **options: Any) -> Master:
        folder = tmp_path / f"{len(masters)} ä"  # as a URI it is quoted
        path = export.fmu(drive, tmp_path / "drive.fmu", fmi=fmi, **options)
        fmpy.extract(str(path), unzipdir=str(folder))
        masters.append(Master(folder))
        return masters[-1]

    yield make
    for each in masters:
        each.fmu.freeInstance()


def command(samples: int = 1500) -> np.ndarray:
    """Voltage that visits dead zone, both limits and both stops."""
    time = np.arange(samples) * H
    noise = np.random.default_rng(3).normal(0.0, 0.7, samples)
    return np.clip(9.5 * np.sin(2.0 * np.pi * 0.8 * time) + noise, -10.0, 10.0)


def stepped(drive: Drive, voltage: Any, h: float = H, **options: Any) -> np.ndarray:
    """What the drive's stepper says."""
    stepper = drive.stepper(1.0 / h, **options)
    samples = [stepper.step(float(each)) for each in voltage]
    return np.array([[getattr(each, name) for name in OUTPUTS] for each in samples])


REFINED = {
    **{"Z7": 0.4, "Z12": 0.003, "spool_friction": 0.05, "spool_presliding": 2e-6},
    **{"solenoid_hysteresis": 0.01, "swash_damping": 0.004, "cam_ripple": 0.02},
    **{"solenoid_delay": 0.0401, "solenoid_lag": 0.015},
}


LIMITED = {"lim1": 40.0, "I_t1": 0.2}


@pytest.mark.parametrize(
    ("changes", "form", "given", "start"),
    [
        ({}, {}, {}, 0.0),
        ({}, {}, {}, 1234.5),
        *rest_slow(
            [
                (REFINED, {}, {}, 0.0),
                (LIMITED, {"coulomb_sign": "literal"}, {"literal_coulomb_sign": True}, 0.0),
                (LIMITED, {"card_switch": "split"}, {"split_card_switch": True}, 0.0),
            ],
            0,
        ),
    ],
    ids=["plain", "late", "refined", "literal Coulomb sign", "split card switch"],
)
def test_equals_the_stepper_at_its_own_step(made, hoist, changes, form, given, start):
    drive, voltage = hoist.replace(**changes), command()
    master = made(drive).begin(start, voltage=voltage[0], **given)
    chosen = Drive(replace(drive.parameters, **form))
    assert np.array_equal(master.played(voltage, start=start), stepped(chosen, voltage))


def test_a_parameter_changed_while_it_runs_counts_from_there_on(made, hoist):
    """The voltage of its instant had been taken: the change acts from the next sample on."""
    voltage = command(800)
    master, after = made(hoist).begin(voltage=voltage[0]), hoist.replace(Z16_plus=2e-4).stepper()
    master.played(voltage[:400])
    master.set(Z16_plus=2e-4)
    assert master.get("Z16_plus") == [2e-4]
    found = master.played(voltage[400:], start=400 * H)
    stepper = hoist.stepper()
    for volts in voltage[:401]:
        stepper.step(volts)
    after.state = stepper.state
    expected = [after.step(volts)[1:] for volts in voltage[401:]]
    assert np.array_equal(found[1:], expected)


def test_holds_a_voltage_over_long_steps(made, hoist):
    master = made(hoist).begin()
    voltage = command(200)
    found = master.played(voltage, 8 * H)
    held = np.repeat(voltage, 8)
    held[0] = 0.0  # initialized at 0 V, and 8 samples later the first voltage has held since
    expected = stepped(hoist, np.repeat(voltage, 8))[::8]
    assert np.array_equal(found[1:], expected[1:])


def test_gives_the_sample_before_at_short_steps(made, hoist):
    interval, count = 1e-3, 1200
    points = np.arange(count) * interval
    voltage = 8.0 * np.sin(7.0 * points)
    found = made(hoist).begin(voltage=voltage[0]).played(voltage, interval)
    samples = np.arange(int(points[-1] / H) + 1)
    # the voltage that was set last at or before each sample
    last = np.floor(samples * H / interval + 1e-9).astype(int)
    expected = stepped(hoist, voltage[last])
    newest = np.floor(points / H + 1e-3).astype(int)
    assert np.array_equal(found, expected[newest])


@pytest.mark.slow
@pytest.mark.parametrize("fmi", ["3.0"])
def test_loses_no_sample_in_an_hour_of_times_that_are_summed_up(made, hoist, fmi):
    master = made(hoist).begin()
    set_voltage, step = master.set, master.fmu.doStep
    time, interval, late = 0.0, 1e-3, 0.0
    for second in range(3600):
        set_voltage(voltage=float(second % 7 - 3))
        for _ in range(1000):
            step(time, interval)
            time += interval
        late = max(late, abs(time - (second + 1)))
    assert 1e-9 < late < 1e-3 * H  # what a grid compared exactly would stumble over
    volts = np.repeat(np.arange(3600) % 7 - 3.0, 512)
    run = hoist.simulate(np.append(volts, 0.0), interpolation="previous")
    assert master.get("shaft_position") == [run.shaft_position[-1]]


@pytest.mark.slow
def test_ramps_by_the_derivative_of_the_input(made, hoist, fmi):
    if fmi == "3.0":
        pytest.skip("FMI 3.0 has no derivatives of inputs")
    voltage = np.array([0.0, 8.0, -6.0, 9.0, 3.0, 3.0])
    long, samples = 0.125, 64
    master = made(hoist).begin()
    for i, (volts, following) in enumerate(pairwise(voltage)):
        master.set(voltage=volts)
        master.fmu.setRealInputDerivatives([0], [1], [(following - volts) / long])
        master.step(i * long, long)
    fine = np.interp(np.arange(5 * samples + 1) / samples, np.arange(6), voltage)
    expected = stepped(hoist, fine)[-1]
    # a slope times a time is not to the last bit a point on a line
    assert master.get(*OUTPUTS) == pytest.approx(expected, rel=1e-9)


def test_instances_do_not_meet(made, hoist, tmp_path):
    one = made(hoist).begin()
    two = Master(tmp_path / "0 ä").begin()
    voltages = command(400), -command(400)
    found = np.empty((2, 400, len(OUTPUTS)))
    for i in range(400):
        for which, master in enumerate((one, two)):
            found[which, i] = master.get(*OUTPUTS)
            master.set(voltage=voltages[which][i])
            master.step(i * H, H)
    two.call("fmi2FreeInstance", "fmi3FreeInstance", two.fmu.component)
    for which, voltage in enumerate(voltages):
        expected = stepped(hoist, voltage)
        assert np.array_equal(found[which, 1:], expected[1:])


def test_state_can_be_set_back_and_stored(made, hoist):
    master, voltage = made(hoist).begin(), command(900)
    master.played(voltage[:300])
    kept = master.state
    after = master.played(voltage[300:], start=300 * H)
    master.state = kept
    assert np.array_equal(master.played(voltage[300:], start=300 * H), after)
    other = made(hoist)
    other.begin()
    other.state = kept
    assert np.array_equal(other.played(voltage[300:], start=300 * H), after)


def test_state_of_another_size_version_or_drive_is_refused(made, hoist):
    master = made(hoist).begin()
    kept = master.state
    wrong = [kept[:-8], kept + bytes(8), b"X" + kept[1:], kept[:8] + b"\x07" + kept[9:], b"SWP"]
    wrong.append(made(hoist.replace(Z16=2e-4)).begin().state)
    for given in wrong:
        with pytest.raises(FMICallException):
            master.state = given
    assert any("another set of numbers" in each for each in master.said)
    assert any("header or size" in each for each in master.said)
    master.state = kept


def test_a_damaged_state_is_refused_and_nothing_of_it_is_set(made, hoist):
    voltage = command(300)
    master = made(hoist).begin(voltage=voltage[0])
    master.played(voltage[:200])
    kept = master.state
    rng = np.random.default_rng(2)
    ends = len(kept) - 1 - rng.integers(0, 600, 40)  # modes, flags and places stand near the end
    for at in (*rng.integers(0, len(kept), 40), *ends, *range(0, 48, 3)):
        wrong = bytearray(kept)
        for extra in rng.integers(0, 8, rng.integers(1, 5)):  # up to four bits within a byte or two
            wrong[min(at + extra // 4, len(kept) - 1)] ^= 1 << (extra % 8)
        if wrong == kept:
            continue
        with pytest.raises(FMICallException):
            master.state = bytes(wrong)
        assert re.search("is damaged|header or size|another set of", master.said[-1])
    assert sum("this state is damaged" in each for each in master.said) > 60
    after = master.played(voltage[200:], start=200 * H)
    assert np.array_equal(after, stepped(hoist, voltage)[200:])


def test_reset_gives_the_start_values_back(made, hoist):
    voltage = command(200)
    master = made(hoist).begin(voltage=voltage[0])
    first = master.played(voltage)
    master.set(Z16_plus=3e-4)
    master.fmu.reset()
    assert master.get("Z16_plus", "voltage") == [hoist["Z16"].value.plus, 0.0]
    master.initialize(voltage=voltage[0])
    assert np.array_equal(master.played(voltage), first)


def test_starts_settled_on_request(made, hoist):
    voltage = np.r_[np.full(20, 5.5), command(300)]
    master = made(hoist).begin(start_steady=True, voltage=5.5)
    found = master.played(voltage)
    assert np.allclose(found, stepped(hoist, voltage, start="steady"), rtol=1e-12, atol=1e-12)
    assert found[0, OUTPUTS.index("shaft_speed")] == pytest.approx(hoist.steady_speed(5.5))


def test_clips_a_voltage_and_says_it_once(made, hoist):
    voltage = np.tile([10.0000001, -12.0, 3.0], 30)
    master = made(hoist).begin()
    found = master.played(voltage)
    expected = stepped(hoist, np.clip(voltage, -10.0, 10.0))
    assert np.array_equal(found[1:], expected[1:])
    assert [each for each in master.said if "clipped" in each] == master.said
    assert len(master.said) == 1


def refuses(master: Master, call: Callable[[], Any], said: str = "") -> None:
    with pytest.raises(FMICallException):
        call()
    assert not said or said in master.said[-1]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("voltage", np.nan), ("load_torque", np.inf), ("Z9", -np.inf), ("tau", np.nan)),
        *(("Z16_plus", -1e-4), ("Z9", 0.0), ("V_dz_minus", -1.0)),
        *(("pump_speed", 1800.0), ("pump_speed", -0.1), ("load_torque", 1e300)),
        ("supply_pressure", 0.0),
    ],
)
def test_refuses_what_is_no_number_or_out_of_range(made, hoist, name, value):
    master = made(hoist).begin(voltage=2.0)
    kept = master.get(name)
    refuses(master, lambda: master.set(**{name: value}), name)
    assert master.get(name) == kept
    master.step(0.0, H)


@pytest.mark.parametrize(
    ("begun", "changed", "said"),
    [
        ({"clip": False}, {"voltage": 11.0}, "voltage is 11, but must be within +-10"),
        ({}, {"tau": 5.0}, "delay"),
    ],
)
def test_a_step_that_cannot_be_made_fails_until_a_reset(made, hoist, begun, changed, said):
    master = made(hoist).begin(**begun)
    master.set(**changed)
    refuses(master, lambda: master.step(0.0, H), said)
    refuses(master, lambda: master.step(0.0, H))
    master.fmu.reset()
    master.initialize()
    master.step(0.0, H)


def test_time_does_not_go_back(made, hoist):
    master = made(hoist).begin()
    master.step(0.0, 0.5)
    for at in ((0.1, H), (0.5, -H), (0.5, np.nan), (np.nan, H), (0.5, np.inf), (-np.inf, H)):
        refuses(master, lambda at=at: master.step(*at))
    master.step(0.5, H)


def test_a_step_begins_where_the_model_stands(made, hoist):
    master, voltage = made(hoist).begin(voltage=4.0), np.full(200, 4.0)
    master.step(0.0, 0.125)
    for time in (5.0, 0.125 + 2.0 * H, 0.0, 1e11):
        refuses(master, lambda time=time: master.step(time, H), "stands at 0.125 s")
    master.step(0.125 + 1e-3 * H, 0.125)  # the rounding of a master's sum
    assert master.get(*OUTPUTS) == stepped(hoist, voltage)[128].tolist()


def test_a_step_too_long_to_wait_for_is_refused(made, hoist):
    master, voltage = made(hoist).begin(voltage=4.0), np.full(200, 4.0)
    for interval in (1e9, 1e300, 2e4):
        refuses(master, lambda interval=interval: master.step(0.0, interval), "at most 19531.25 s")
    master.step(0.0, 64 * H)
    assert master.get(*OUTPUTS) == stepped(hoist, voltage)[64].tolist()


@pytest.mark.parametrize("times", [(np.nan,), (np.inf,), (-1e300,), (0.0, np.nan), (5.0, 1.0)])
def test_start_and_stop_are_finite_and_in_order(made, hoist, times):
    master = made(hoist)
    master.instantiate()
    names = ("startTime", "stopTime")
    begin = master.fmu.setupExperiment if master.two else master.fmu.enterInitializationMode
    refuses(master, lambda: begin(**dict(zip(names, times, strict=False))), "time")
    master.initialize(0.5)
    master.step(0.5, H)


def test_calls_in_a_wrong_order_fail(made, hoist):
    master = made(hoist)
    master.instantiate()
    refuses(master, lambda: master.step(0.0, H))
    refuses(master, master.fmu.exitInitializationMode)
    master.initialize()
    refuses(master, master.fmu.enterInitializationMode)
    refuses(master, lambda: master.set(start_steady=True))  # fixed by then
    for reference in (99, 310, 4_000_000_000):
        refuses(master, lambda reference=reference: master.read([reference]))


def test_a_run_that_has_begun_keeps_its_start(made, hoist, fmi):
    if fmi == "3.0":
        pytest.skip("FMI 3.0 takes the start with the beginning of initialization")
    master, voltage = made(hoist).begin(voltage=4.0), np.full(80, 4.0)
    for start in (np.nan, 1e9, -1e9, 0.0):
        refuses(master, lambda start=start: master.fmu.setupExperiment(startTime=start), "stepping")
    master.step(0.0, 64 * H)
    assert master.get(*OUTPUTS) == stepped(hoist, voltage)[64].tolist()


def test_after_termination_values_can_be_read_and_nothing_else_done(made, hoist):
    master = made(hoist)
    master.instantiate()
    refuses(master, master.fmu.terminate, "before initialization")
    master.initialize(voltage=4.0)
    master.step(0.0, 64 * H)
    kept, last = master.state, master.get(*OUTPUTS)
    master.fmu.terminate()
    assert master.get(*OUTPUTS) == last
    refuses(master, lambda: master.step(64 * H, H), "after termination")
    refuses(master, lambda: master.set(voltage=1.0), "after termination")
    refuses(master, master.fmu.terminate, "after termination")
    assert master.get(*OUTPUTS) == last
    master.state = kept
    master.step(64 * H, H)
    master.fmu.terminate()
    master.fmu.reset()
    master.initialize()
    master.step(0.0, H)


@pytest.mark.parametrize("cause", ["overflow", "delay"])
def test_after_a_failure_outputs_are_refused_and_a_reset_heals(made, hoist, cause):
    huge = Drive(hoist.parameters.with_numbers({"Z10": 1e308}))
    master = made(huge if cause == "overflow" else hoist).begin(voltage=4.0)
    master.step(0.0, H)
    master.set(**({"pump_speed": 10.0} if cause == "overflow" else {"tau": 5.0}))
    refuses(master, lambda: master.step(H, H), cause)
    refuses(master, lambda: master.get("shaft_speed"), "after the failure")
    refuses(master, lambda: master.step(H, H), "after the failure")
    refuses(master, lambda: master.set(voltage=1.0), "after the failure")
    assert master.get("voltage") == [4.0]
    master.fmu.terminate()
    master.fmu.reset()
    master.initialize()
    master.step(0.0, H)
    assert np.isfinite(master.get(*OUTPUTS)).all()


def test_ramps_that_lead_out_of_a_range_fail_with_the_name(made, hoist, fmi):
    if fmi == "3.0":
        pytest.skip("FMI 3.0 has no derivatives of inputs")
    master = made(hoist).begin()
    speed = master.by_name["pump_speed"].valueReference
    for slope in (np.nan, -np.inf, 1e308):
        refuses(master, lambda slope=slope: master.fmu.setRealInputDerivatives([0], [1], [slope]))
    master.fmu.setRealInputDerivatives([speed], [1], [10.0])
    refuses(master, lambda: master.step(0.0, 2.0), "pump_speed is 10.0")
    refuses(master, lambda: master.get("shaft_speed"), "after the failure")


@pytest.mark.slow
def test_late_without_a_delay_unless_inputs_are_set_first(made):
    """Without a delay outputs depend on the voltage of their instant."""
    drive, voltage = Drive.preset("neutral").replace(Z12=0.01), command(400)
    with pytest.warns(UserWarning, match="below 1.5 steps"):
        master = made(drive).begin(voltage=voltage[0])
    expected = stepped(drive, voltage)
    late = master.played(voltage)
    wrong = {name: float(np.abs(late - expected)[:, i].max()) for i, name in enumerate(OUTPUTS)}
    assert wrong["current"] > 1e-3
    assert wrong["shaft_speed"] > 1e-6
    assert wrong["stroker_pressure"] == wrong["swash_angle"] == 0.0  # states never
    with pytest.warns(UserWarning, match="below 1.5 steps"):
        other = made(drive).begin(voltage=voltage[0])
    for i, volts in enumerate(voltage):
        other.set(voltage=volts)
        assert other.get(*OUTPUTS) == expected[i].tolist()
        other.step(i * H, H)


def test_measured_inputs_count_at_their_own_sample(made, hoist):
    drive = hoist.replace(motor_leakage=2e-5, load_inertia=0.3, Z12=0.003)
    voltage, size = command(500), 500
    rng = np.random.default_rng(5)
    inputs = {
        "load_torque": rng.normal(200.0, 50.0, size),
        "pump_speed": rng.normal(1.0, 0.05, size),
        "supply_pressure": rng.normal(1e7, 1e5, size),
    }
    run = drive.simulate(voltage, interpolation="previous", **inputs)
    names = (*OUTPUTS, "motor_torque")
    expected = np.array([run[name] for name in names]).T
    master = made(drive).begin()
    for i, volts in enumerate(voltage):
        master.set(voltage=volts, **{name: float(each[i]) for name, each in inputs.items()})
        assert master.get(*names) == expected[i].tolist(), i
        master.step(i * H, H)


def test_supply_pressure_is_z9_until_it_is_set(made, hoist):
    voltage = command(300)
    master = made(hoist).begin(Z9=9e6, supply_pressure=hoist["Z9"].value, voltage=voltage[0])
    changed = hoist.replace(Z9=9e6)
    assert np.allclose(master.played(voltage), stepped(changed, voltage), rtol=1e-12, atol=1e-12)
    assert not np.allclose(stepped(hoist, voltage), stepped(changed, voltage), rtol=1e-3)


def test_damaged_files_make_no_instance(made, hoist, tmp_path):
    master = made(hoist)
    folder = tmp_path / "0 ä"
    resource = folder / "resources" / "drive.bin"
    good = resource.read_bytes()
    wrong = [b"", good[:-1], good + b"\0", b"X" + good[1:], good[:12] + b"\x01" + good[13:]]
    wrong.append(good[:25] + bytes([good[25] ^ 1]) + good[26:])  # another token
    wrong.append(good[:16] + b"12345678" + good[24:])  # another layout
    wrong.append(good[:96] + np.array([np.nan]).tobytes() + good[104:])  # V_dz_plus
    for content in wrong:
        resource.write_bytes(content)
        with pytest.raises(Exception, match="Failed to instantiate"):
            master.instantiate()
    assert all("export the FMU again" in each for each in master.said)
    shutil.rmtree(folder / "resources")
    with pytest.raises(Exception, match="Failed to instantiate"):
        master.instantiate()
    assert "cannot be read" in master.said[-1]
    (folder / "resources").mkdir()
    resource.write_bytes(good)
    master.begin()


@pytest.mark.slow
def test_own_step_can_be_set_where_the_filter_is_an_equation(made, hoist):
    drive = hoist.at_every_rate()
    voltage = command(400)
    master = made(drive).begin(step=1e-3, voltage=voltage[0])
    found = master.played(voltage, 1e-3)
    # constants are those of another library of functions
    assert np.allclose(found, stepped(drive, voltage, 1e-3), rtol=1e-12, atol=1e-12)
    recursion = made(hoist)
    recursion.instantiate()
    refuses(recursion, lambda: recursion.set(step=1e-3), "recursion")
    recursion.initialize()


def test_comparison_says_what_is_equal(hoist, tmp_path, fmi):
    path = export.fmu(hoist, tmp_path / "drive.fmu", fmi=fmi)
    found = export.compare(path, hoist, command(500))
    assert found.equal
    assert found.samples == 500
    assert set(found.differences) == {*OUTPUTS, "motor_torque", "motor_pressure_drop"}
    other = export.compare(path, hoist.replace(Z10=12.0), command(500))
    assert not other.equal
    assert other.differences["shaft_speed"] > 1e-3
    assert other.differences["current"] == 0.0
    assert "shaft_speed" in other.summary()


def test_comparison_refuses_what_it_cannot_run(hoist, tmp_path):
    (tmp_path / "no.fmu").write_bytes(b"no")
    with pytest.raises(ValueError, match="no.fmu is not an FMU"):
        export.compare(tmp_path / "no.fmu", hoist, command(10))
    path = export.fmu(hoist, tmp_path / "drive.fmu")
    with pytest.raises(ValueError, match="two samples"):
        export.compare(path, hoist, [1.0])
    with pytest.raises(ValueError, match="a Machine, not with Model"):
        export.compare(path, pump_drive, command(10))
