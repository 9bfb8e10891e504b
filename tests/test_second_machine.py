"""The second machine of the benches: apart from swashplate, and right by other means."""

import ast
import csv
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from tests.marks import rest_slow

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
FOLDER = BENCHMARKS / "second_machine"


@pytest.fixture(scope="module")
def machine() -> ModuleType:
    """The package with its modules."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        import second_machine.checks
        import second_machine.draws
        import second_machine.equations
        import second_machine.faults
        import second_machine.logger

        return second_machine


def test_nothing_of_swashplate_is_imported() -> None:
    """Truth and model share no line: imports stay within the folder, NumPy, Numba and SciPy."""
    outside = set()
    for path in FOLDER.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Import):
                outside |= {name.name.partition(".")[0] for name in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                outside.add((node.module or "").partition(".")[0])
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id not in {"__import__", "exec", "eval"}, path.name
    assert {"numpy", "numba"} <= outside
    assert not outside & {"swashplate", "importlib", "subprocess"}


# voltage, current [A] and speed [deg/s], worked out from the published tables without a march
STATIC = [
    ("hoist", 1.0, 0.3184, 22.25),
    ("hoist", -4.0, 0.5093, -85.72),
    ("hoist", 9.0, 0.7452, 196.0),
    ("slew", 4.0, 0.3185, 3.23),
    ("slew", -9.0, 0.4890, -4.29),
]


@pytest.mark.parametrize(("axis", "volts", "current", "speed"), STATIC)
def test_march_ends_at_the_published_static_levels(
    machine: ModuleType, axis: str, volts: float, current: float, speed: float
) -> None:
    numbers = machine.draws.published(axis)
    command = machine.controller.held_exactly(lambda t: np.full(t.size, volts), 4.0, 10.0)
    end = machine.logger.Machine(numbers).march(command, 4.0)[-1]
    # the slew card's Coulomb term holds the current within C/omega², 0.5 mA, which is 0.011 deg/s
    stuck = max(numbers[f"C_{way}"] / numbers[f"omega_{way}"] ** 2 for way in ("plus", "minus"))
    assert end[1] + end[2] == pytest.approx(current, abs=6e-5 + stuck)
    assert np.rad2deg(end[5]) == pytest.approx(speed, abs=0.05 if axis == "hoist" else 0.017)


@pytest.mark.slow
def test_gain_of_an_ammeter_is_equal_to_other_numbers(machine: ModuleType) -> None:
    """The machine in an ammeter's amperes reads as the gain says and turns the same."""
    numbers = machine.draws.drawn_parameters("slew", 1005)
    length, wish = machine.controller.maneuver("ramp +1 V/s", "slew")
    command = machine.controller.held_exactly(wish, length, 100.0)
    rows = machine.logger.Machine(numbers).march(command, length)
    other = machine.logger.Machine(machine.draws.as_read(numbers, 1.005)).march(command, length)
    assert other[:, 1] == pytest.approx(1.005 * rows[:, 1], abs=1e-9)
    assert other[:, 4] == pytest.approx(rows[:, 4], abs=1e-9)


def test_converted_filter_follows_the_recursion(machine: ModuleType) -> None:
    """Free samples of Kruse's recursion lie on the converted equation's exponentials."""
    for zeta, omega in ((0.71887, 56.253), (1.4157, 98.377)):
        h = 1.0 / 512.0
        printed = np.roots(
            [1.0, -2.0 * (1.0 - zeta * omega * h), 1.0 - 2.0 * zeta * omega * h + (omega * h) ** 2]
        )
        new_zeta, new_omega = machine.equations.continuous_filter(zeta, omega)
        rates = np.roots([1.0, 2.0 * new_zeta * new_omega, new_omega**2])
        assert np.sort_complex(np.exp(rates * h)) == pytest.approx(np.sort_complex(printed))


@pytest.mark.slow
@pytest.mark.parametrize("run", range(5))
def test_march_agrees_with_scipy(machine: ModuleType, run: int) -> None:
    """Every signal to 1e-4 of its range; measured are 6.1e-5 at most."""
    shares = machine.checks.differences(*machine.checks.RUNS[run])
    assert max(shares.values()) < 1e-4, shares


@pytest.mark.slow
def test_campaign_is_as_a_logger_leaves_it(machine: ModuleType, tmp_path: Path) -> None:
    equipment = machine.draws.drawn_equipment("luff", 1003, rate=50.0)
    truth = machine.logger.write_campaign(equipment, tmp_path)
    logs = sorted((tmp_path / "logs").iterdir())
    by_time = sorted(logs, key=lambda path: path.stat().st_mtime)
    assert [path.name for path in by_time] == truth["runs"]
    assert by_time != logs
    assert set(truth["held_out"]) < {path.name for path in logs}
    with (tmp_path / "logs" / "luff_step_+9_V.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0])[:4] == ["time [s]", "voltage [V]", "current [A]", "encoder [counts]"]
    counts = np.array([float(row["encoder [counts]"]) for row in rows])
    volts = np.array([float(row["voltage [V]"]) for row in rows])
    time = np.array([float(row["time [s]"]) for row in rows])
    assert np.diff(time) == pytest.approx(np.full(time.size - 1, 0.02), abs=5e-4)
    assert volts[100:250] == pytest.approx(np.full(150, 9.0), abs=0.02)
    # within a count of the angle that the machine, drawn once more, turned through
    numbers = machine.draws.drawn_parameters("luff", 1003)
    assert numbers == truth["parameters"]
    length, wish = machine.controller.maneuver("step +9 V", "luff")
    plc = machine.draws.drawn_controller("luff", 1003, "step +9 V")
    command = machine.controller.held(wish, length, plc)
    order, _ = machine.draws.day("luff", 1003)
    condition = machine.draws.drawn_conditions("luff", 1003)[order.index("step +9 V")]
    turned = machine.logger.Machine(numbers).march(command, length, condition)[-1, 4]
    turns = (counts[-1] - counts[0]) / truth["counts_per_turn"]
    assert 2.0 * np.pi * turns == pytest.approx(turned, abs=4.0 * np.pi / truth["counts_per_turn"])


SIGNALS = {
    "none": "",
    "run of another axis": "",
    "spool friction": "counts",
    "leakage under load, 10 % of the top speed": "counts",
    "leakage under load, 2 % of the top speed": "counts",
    "drift of 8 % over the campaign": "counts",
    "encoder 20 ms late": "counts",
    "ammeter clipped": "current",
    "delay 20 ms longer than stated": "counts current",
    "runs missing": "",
    "encoder reads 3 % too much": "counts",
    "ammeter reads 3 % too much": "current",
    "command's stamps 20 ms late": "voltage",
    "encoder loses counts above 70 % of the top speed": "counts",
    "supply pressure 20 % low": "counts",
    "command read with 8 bits": "voltage",
    "play of 0.2 degrees before the encoder": "counts",
    "one run late by 0.2 s": "",
    "one run of an encoder that slips by 5 %": "",
    "one run reversed": "",
    "one run without counts": "",
    "weak dither": "counts",
    "shaft of 8 Hz": "counts",
    "charge pressure that hunts by 10 %": "counts",
    "charge pressure that droops by 10 %": "counts",
    "charge pressure set anew in each run, 5 %": "counts",
    "cold oil, orifices 20 % less at first": "counts",
    "load in every second run": "counts",
    "ammeter of 5 Hz": "current",
    "command 50 mV off": "voltage",
    "command reads 2 % too much": "voltage",
}
"""What a fault changes in the log of a step of 9 V."""


@pytest.mark.parametrize("fault", rest_slow([*SIGNALS], 3))
def test_fault_changes_what_it_says_and_nothing_else(machine: ModuleType, fault: str) -> None:
    run = "step +9 V"
    sound = machine.draws.drawn_equipment("hoist", 1000)
    faulty = machine.faults.FAULTS[fault](sound)
    before = machine.logger.drive_columns(sound, run)
    after = machine.logger.drive_columns(faulty, run)
    assert list(before) == list(after)
    changed = {name.split()[0] for name in before if before[name] != after[name]}
    assert changed == {{"counts": "encoder"}.get(word, word) for word in SIGNALS[fault].split()}
    lost = {name for name in sound.conditions if "-" in name} if fault == "runs missing" else set()
    assert sound.conditions.keys() - faulty.conditions.keys() == lost
    assert set(sound.held_out) - set(faulty.held_out) == lost & set(sound.held_out)
    spoilt = {"run of another axis": {"ramp +1 V/s"}}
    alone = {"sine 4 V 0.1 Hz"} if fault.startswith("one run") else set()
    assert set(faulty.elsewhere) == spoilt.get(fault, alone)


def test_every_fault_is_tested(machine: ModuleType) -> None:
    assert set(SIGNALS) == set(machine.faults.FAULTS)


def logged(machine: ModuleType, fault: str) -> dict[str, np.ndarray]:
    """A step of hoist by the first word of its columns' names."""
    equipment = machine.faults.FAULTS[fault](machine.draws.drawn_equipment("hoist", 1000))
    texts = machine.logger.drive_columns(equipment, "step +9 V")
    return {name.split()[0]: np.array(column, dtype=float) for name, column in texts.items()}


@pytest.mark.slow
def test_sizes_of_faults_of_instruments(machine: ModuleType) -> None:
    before = logged(machine, "none")
    late = np.interp(before["time"] - 0.02, before["time"], before["encoder"])
    assert logged(machine, "encoder 20 ms late")["encoder"] == pytest.approx(late, abs=2.0)
    turned, more = (
        logged(machine, fault)["encoder"][-1] for fault in ("none", "encoder reads 3 % too much")
    )
    assert more == pytest.approx(1.03 * turned, abs=5.0)  # counters begin at 0 to 4
    clipped = logged(machine, "ammeter clipped")["current"]
    assert clipped == pytest.approx(np.minimum(before["current"], 0.45))
    current = logged(machine, "ammeter reads 3 % too much")["current"]
    assert current == pytest.approx(1.03 * before["current"], abs=1.1e-3)
    # 8 bits over 20 V
    coarse = np.unique(logged(machine, "command read with 8 bits")["voltage"])
    assert coarse / (20.0 / 256.0) == pytest.approx(np.round(coarse / (20.0 / 256.0)), abs=1e-4)
    moved = [
        values["time"][np.argmax(values["voltage"] > 4.5)]
        for values in (before, logged(machine, "command's stamps 20 ms late"))
    ]
    assert moved[1] - moved[0] == pytest.approx(0.02, abs=0.003)


def test_sizes_of_faults_of_the_machine(machine: ModuleType) -> None:
    sound = machine.draws.drawn_equipment("hoist", 1000)
    top = machine.faults.top_speed(sound)
    numbers = machine.draws.published("hoist")
    # the speed of STATIC at 9 V is that of the plate's stop
    published = machine.faults.top_speed(replace(sound, parameters=numbers))
    assert np.rad2deg(published) == pytest.approx(196.0, abs=0.05)

    def settled(fault: str, volts: float) -> float:
        equipment = machine.faults.FAULTS[fault](sound)
        command = machine.controller.held_exactly(lambda t: np.full(t.size, volts), 4.0, 10.0)
        steady = machine.logger.Machine(equipment.parameters)
        return float(steady.march(command, 4.0, equipment.steady)[-1, 5])

    for volts in (9.0, -9.0):
        loss = settled("none", volts) - settled("leakage under load, 10 % of the top speed", volts)
        assert loss == pytest.approx(np.sign(volts) * 0.1 * top, rel=1e-3)
    assert settled("leakage under load, 10 % of the top speed", 0.0) == 0.0
    # on average over the fitted runs nothing drifts
    speeds = [
        machine.faults.FAULTS["drift of 8 % over the campaign"](sound).conditions[run].speed
        / condition.speed
        for run, condition in sound.conditions.items()
    ]
    fitted = [run not in sound.held_out for run in sound.conditions]
    assert np.ptp(speeds) == pytest.approx(0.08)
    assert np.mean(np.array(speeds)[fitted]) == pytest.approx(1.0)


@pytest.mark.slow
def test_what_no_fit_can_see(machine: ModuleType) -> None:
    """Gains that other numbers of hoist take up; a late encoder has no such numbers."""
    sound = machine.draws.drawn_equipment("hoist", 1000)
    faults = machine.faults
    for fault in (faults.encoder_gain, faults.ammeter_gain, faults.low_supply):
        assert faults.unseen(fault, sound)
    assert not faults.unseen(faults.encoder_late, sound)
