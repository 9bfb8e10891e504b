"""Many sets at once, of drives and of models of one's own: bits, costs, files, refusals."""

import re
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl
import pytest

from swashplate import (
    Drive,
    FileError,
    InputError,
    Processes,
    Serial,
    SquaredError,
    Threads,
    simulate_many,
)
from swashplate.environment import compiles, told_processor
from swashplate.machine import Machine, Model, Tap, equation, simulate
from swashplate.machine.code_generation.machine_code import optimised
from swashplate.machine.marching import CodeForm, SampleCode, output_of
from swashplate.machine.marching.lanes import lanes_text
from swashplate.models.displacement_control import PumpOptions
from swashplate.models.drive import pump_drive

RATE, COUNT = 100.0, 37
COMMAND = np.sin(np.arange(400) / 25.0) + 0.3
INPUTS = {"command": COMMAND}


class Valve(NamedTuple):
    lag: float
    gain: float
    delay: float = 0.03


class Rod(NamedTuple):
    opening: float
    position: float


class Stroke(NamedTuple):
    low: float
    high: float


@equation
def step(state: Rod, command: float, p: Valve, h: float, given: Stroke) -> Rod:
    opening = state.opening + h / p.lag * (command - state.opening)
    return Rod(opening, min(max(state.position + h * p.gain * opening, given.low), given.high))


@equation
def room(state: Rod) -> float:
    return 10.0 - abs(state.opening)


valve = Model(
    "valve",
    Valve,
    Rod,
    step,
    given=Stroke,
    taps={"command": Tap("command", delay="delay")},
    domain=room,
    outside="the valve bursts",
)
P, STROKE = Valve(0.05, 0.4), Stroke(-0.05, 0.3)
SETS = {
    "gain": np.linspace(0.1, 0.9, COUNT),
    "lag": np.full(COUNT, 0.05),
    "delay": np.linspace(0.0, 0.1, COUNT),
}
SETS["gain"][5], SETS["lag"][7], SETS["delay"][9] = np.nan, 1e-4, -0.01
FAILED = [5, 7, 9]


def many(**options):
    return simulate_many(Machine(valve, P, given=STROKE), SETS, INPUTS, RATE, **options)


def test_sets_begin_where_they_are_told_to() -> None:
    """A set's own state at the first sample, as `simulate` takes it, to the last bit."""
    begins = np.linspace(-0.04, 0.2, COUNT)
    changes = {"start.position": begins, "gain": np.linspace(0.1, 0.9, COUNT)}
    batch = simulate_many(
        Machine(valve, P, given=STROKE), changes, INPUTS, RATE, output="position", executor=Serial()
    )
    assert not batch.failures
    for k in (0, 17, COUNT - 1):
        p = P._replace(gain=changes["gain"][k])
        begin = {"position": begins[k]}
        run = simulate(Machine(valve, p, given=STROKE), INPUTS, RATE, begin=begin)
        assert np.array_equal(batch.output[k], run["position"])
    many = {"pump.Z10": np.full(3, 12.0), "start.pump.pressure": np.array([0.0, 2e5, 4e5])}
    parts = Drive.preset("hoist").by_current.parts
    p = pump_drive.parameters(*(part.p for part in parts))
    options = pump_drive.options(parts[1].options)
    record = {"current": np.full(200, 0.45)}
    found = simulate_many(
        Machine(pump_drive, p, options=options), many, record, 512.0, output="shaft_speed"
    )
    begin = {"pump.pressure": 4e5}
    p = p._replace(pump=p.pump._replace(Z10=12.0))
    run = simulate(Machine(pump_drive, p, options=options), record, 512.0, begin=begin)
    assert np.array_equal(found.output[2], run["shaft_speed"])


def test_each_set_is_what_it_is_alone_to_the_last_bit() -> None:
    found = many(output="position")
    assert found.output.shape == (COUNT, COMMAND.size)
    for k, row in enumerate(found.output):
        if k in FAILED:
            assert np.isnan(row).all()
            continue
        p = Valve(*(float(SETS[name][k]) for name in Valve._fields))
        assert (simulate(Machine(valve, p, given=STROKE), INPUTS, RATE)["position"] == row).all()
    assert list(found.failures) == FAILED
    assert found.failures[5] == "valve: gain is nan, but must be a finite number."
    assert found.failures[7] == "valve: the valve bursts under this command."
    assert found.failures[9] == "valve: delay is -0.01, but must be a finite number, at least 0."
    assert found.output[20].max() == STROKE.high


def test_costs_are_those_of_the_outputs() -> None:
    measured, weight = np.cos(COMMAND), np.linspace(0.0, 1.0, COMMAND.size)
    found = many(cost=SquaredError(measured, weight, "position"))
    assert found.output is None
    expected = np.sum(weight * (many(output="position").output - measured) ** 2, axis=1)
    assert found.cost == pytest.approx(np.where(np.isnan(expected), np.inf, expected))


@pytest.mark.parametrize("per_file", [2**23, 1])
def test_outputs_are_streamed_to_files(tmp_path: Path, monkeypatch, per_file: int) -> None:
    monkeypatch.setattr("swashplate.machine.batch.SAMPLES_A_FILE", per_file)
    found = many(output="position", to=tmp_path / "outputs")
    assert found.output is None
    assert sorted(found.files) == sorted((tmp_path / "outputs").iterdir())
    assert len(found.files) == (1 if per_file > 1 else 3)
    assert list(found.failures) == FAILED
    wanted, seen = many(output="position").output, []
    for path in found.files:
        table = pl.read_parquet(path)
        assert (table["time"].to_numpy() == np.arange(COMMAND.size) / RATE).all()
        for name in table.columns[1:]:
            seen.append(int(name))
            assert np.array_equal(table[name].to_numpy(), wanted[int(name)], equal_nan=True)
    assert sorted(seen) == [k for k in range(COUNT) if k not in (5, 9)]
    with pytest.raises(FileError, match=r"outputs .*0.*\.parquet; .* empty folder"):
        many(output="position", to=tmp_path / "outputs")


@pytest.mark.slow
def test_executors_give_the_same(tmp_path: Path) -> None:
    """Of a packaged model, which other processes can import."""
    hoist = Drive.preset("hoist")
    instance = hoist.by_current
    current = 0.9 * np.sin(np.arange(300) / 40.0)
    numbers = 1.2e-4 * np.linspace(0.8, 1.2, 20)
    parts = [part.p for part in instance.parts]
    options = pump_drive.options(pump=instance.parts[1].options)

    def run(executor, **more):
        return simulate_many(
            Machine(pump_drive, pump_drive.parameters(*parts), options=options),
            {"pump.Z16_plus": numbers},
            {"current": current},
            512.0,
            output="shaft_speed",
            executor=executor,
            **more,
        )

    by_drive = hoist.simulate_many({"Z16_plus": numbers}, current=current)
    for executor in (Serial(), Threads(3), Processes(2)):
        assert (run(executor).output == by_drive.output).all()
    files = run(Processes(2), to=tmp_path).files
    table = pl.read_parquet(files[0])
    assert (table["19"].to_numpy() == by_drive.output[19]).all()
    drives = hoist.simulate_many(
        {"Z16_plus": numbers}, current=current, to=tmp_path / "drives", executor=Serial()
    )
    assert pl.read_parquet(drives.files[0]).equals(table)


REFUSED = {
    "parameter": ({"changes": {"lead": [1.0]}}, "parameter 'lead'.* lag, gain, delay"),
    "no sets": ({"changes": {}}, "number of sets"),
    "text": ({"changes": {"lag": ["slow"]}}, "lag.* one number per set"),
    "output": ({"output": "speed"}, "valve .*'speed'.* opening, position"),
    "nothing wanted": ({"output": ""}, "valve: .* output"),
    "cost": ({"cost": SquaredError(COMMAND)}, "valve .* 'shaft_speed'"),
    "no input": ({"inputs": {}}, "valve .* 'command'"),
    "memory": (
        {"changes": {"lag": np.full(100_000, 0.1)}, "inputs": {"command": np.zeros(2_000_000)}},
        "100000 sets, 2000000 .* 1.49e.03 GiB, .* cost, or .* to=FOLDER",
    ),
    "processes": ({"executor": Processes(2)}, "valve .* another process"),
}


@pytest.mark.parametrize(("options", "sentence"), REFUSED.values(), ids=REFUSED)
def test_bad_batches_are_refused(options, sentence: str) -> None:
    if "another process" in sentence:
        unnamed = Model("valve", Valve, Rod, step, given=Stroke)
        options = {**options, "machine": Machine(unnamed, P, given=STROKE)}
    asked = {
        "machine": Machine(valve, P, given=STROKE),
        "changes": {"lag": np.full(40, 0.1)},
        "inputs": INPUTS,
        "rate": RATE,
        "output": "position",
        **options,
    }
    with pytest.raises(InputError, match=sentence):
        simulate_many(**asked)


STREAMED = """
import resource, sys
import numpy as np
from swashplate import Drive, Serial

sets, folder = int(sys.argv[1]), sys.argv[2]
drive, voltage = Drive.preset("hoist"), np.full(200_000, 3.0)
spread = {"Z8": drive["Z8"].value * np.linspace(0.9, 1.1, sets)}
found = drive.simulate_many(spread, voltage=voltage, to=folder, executor=Serial())
assert len(found.files) > 1 and not found.failures
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.slow
def test_memory_does_not_grow_with_the_sets_that_are_streamed(tmp_path: Path) -> None:
    """Of 400 sets more, 640 MB of outputs, a twentieth at most."""
    peaks = []
    for sets in (100, 500):
        words = [sys.executable, "-c", STREAMED, str(sets), str(tmp_path / str(sets))]
        done = subprocess.run(words, capture_output=True, text=True, check=True)
        peaks.append(1024.0 * int(done.stdout))
    assert peaks[1] - peaks[0] < 400 * 200_000 * 8 / 20


@pytest.mark.traced
def test_bad_sets_do_not_stop_the_others(hoist: Drive) -> None:
    voltage = np.full(300, 5.0)
    changes = {"Z16_plus": [1.2e-4, -1.0, 1.3e-4], "Z19_plus": [12.0, 12.0, 1200.0]}
    batch = hoist.simulate_many(changes, voltage=voltage, cost=SquaredError(np.zeros(300)))
    assert np.isfinite(batch.cost[0])
    assert list(np.isinf(batch.cost)) == [False, True, True]
    assert "Z16_plus" in batch.failures[1]
    assert "above 0" in batch.failures[1]
    assert "Z5·F/√Z4" in batch.failures[2]
    outputs = hoist.simulate_many(changes, voltage=voltage).output
    assert np.isfinite(outputs[0]).all()
    assert np.isnan(outputs[1:]).all()


@pytest.mark.parametrize(
    ("zeta", "omega"), [(0.3, 409.6), (0.3, 307.0), (0.9, 950.0), (2.0, 275.0)]
)
def test_a_batch_refuses_the_filters_that_simulate_refuses(hoist: Drive, zeta, omega) -> None:
    changes = {"zeta": [zeta, 1.0], "omega": [omega, 56.0]}
    batch = hoist.simulate_many(changes, voltage=np.ones(50))
    try:
        hoist.replace(zeta=zeta, omega=omega).simulate(np.ones(50))
    except InputError:
        assert list(batch.failures) == [0]
        assert "unstable" in batch.failures[0]
        assert np.isnan(batch.output[0]).all()
    else:
        assert not batch.failures


def test_overflow_fails_only_its_set(hoist: Drive) -> None:
    for record in ({"voltage": np.full(600, 5.0)}, {"current": np.full(600, 0.5)}):
        for cost in (None, SquaredError(np.zeros(600))):
            batch = hoist.simulate_many({"Z7": [0.0, 1e150, 1e-3]}, cost=cost, **record)
            assert list(batch.failures) == [1]
            assert "overflow" in batch.failures[1]
            results = batch.output if cost is None else batch.cost
            assert np.isfinite(results[[0, 2]]).all()
            assert not np.isfinite(results[1]).any()


def test_bad_sets_of_a_drive_are_refused(hoist: Drive) -> None:
    with pytest.raises(InputError, match="Z16_plus .* twice"):
        hoist.simulate_many({"Z16": [1e-4], "Z16_plus": [1e-4]}, voltage=[0.0])
    with pytest.raises(InputError, match="voltage or a current"):
        hoist.simulate_many({"Z10": [3.0]}, voltage=[0.0], current=[0.0])


@pytest.mark.traced
def test_samples_without_weight_may_be_missing(hoist: Drive) -> None:
    cost = SquaredError([0.0, np.nan, 1.0], [1.0, 0.0, 1.0])
    batch = hoist.simulate_many({"Z10": [12.396]}, voltage=[0.0, 0.0, 0.0], cost=cost)
    speed = hoist.simulate([0.0, 0.0, 0.0]).shaft_speed
    assert batch.cost[0] == pytest.approx(speed[0] ** 2 + (speed[2] - 1.0) ** 2, rel=1e-14)


def test_names_of_equations_are_not_those_of_the_march(hoist: Drive) -> None:
    """The card's differential equation has a `length`, as the rows of a batch's outputs have."""
    drive = hoist.at_every_rate()
    voltage = 6.0 * np.sin(np.arange(300) / 40.0)
    batch = drive.simulate_many({"Z10": [12.0, 13.0]}, voltage=voltage)
    for Z10, speed in zip((12.0, 13.0), batch.output, strict=True):
        np.testing.assert_array_equal(speed, drive.replace(Z10=Z10).simulate(voltage).shaft_speed)


@pytest.mark.skipif(not compiles(), reason="nothing is compiled")
@pytest.mark.skipif(told_processor() == "generic", reason="vectors of two do not pay")
def test_the_sets_are_marched_as_vectors() -> None:
    signal, integral = output_of(pump_drive, "shaft_speed")
    sample_code = SampleCode(pump_drive, CodeForm(("current",), (None, PumpOptions())), [signal])
    text = str(optimised(lanes_text(sample_code, signal, integral=integral)))
    assert re.search(r"<\d+ x double> @llvm\.sqrt", text)
    assert not re.search(r"gather|call double @llvm\.sqrt", text)
