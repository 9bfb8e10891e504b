"""The benches behind the tables of the documentation: they run on the package as it is."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from swashplate import Drive

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


@pytest.fixture(scope="module")
def bench() -> ModuleType:
    """The bench of faults as a module."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        import faults

        return faults


@pytest.fixture(scope="module")
def calibration() -> ModuleType:
    """The bench of intervals as a module."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        import calibration

        return calibration


@pytest.mark.slow
def test_calibration_goes_from_logs_to_tables_and_goes_on(tmp_path: Path) -> None:
    """One campaign: drafted, fitted, predicted, counted; a second call does not run it again."""

    def run() -> str:
        done = subprocess.run(
            [
                sys.executable,
                str(BENCHMARKS / "calibration.py"),
                *("--axis", "luff", "--rate", "50", "--campaigns", "1", "--development"),
                *("--jobs", "1", "--out", "found.jsonl"),
            ],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    first = run()
    lines = (tmp_path / "found.jsonl").read_text("utf-8").splitlines()
    assert len(lines) == 1
    record = json.loads(lines[0])
    assert (record["axis"], record["seed"], record["rate"]) == ("luff", 1000, 50.0)
    rows = {row["name"]: row for row in record["estimates"]}
    assert {"V_dz_plus", "omega_plus", "Z8", "Z19_minus"} <= set(rows)
    assert rows["Z8"]["value"] == pytest.approx(rows["Z8"]["truth"], rel=0.2)
    assert len(record["new"]) == 5
    assert max(record["new"].values()) < 5.0
    assert "| luff | with | 30 % | 0 % | 50 | 1 (1000 to 1000) |" in first
    # ramps pass the dead zone; no test reaches the spool's stop
    assert rows["V_dz_plus"]["told"]
    assert not rows["Z14"]["told"]
    assert {each["maneuver"] for each in record["statements"]} == set(record["new"])
    bands = {each["maneuver"]: each for each in record["bands"]}
    assert set(bands) == set(record["new"])
    # the chirp is faster than any test: its band is wider than that of the stair
    assert bands["chirp"]["band"] > bands["stair"]["band"]
    assert all(each["true"] < each["band"] and each["inside"] > 0.9 for each in bands.values())
    assert run() == first
    assert len((tmp_path / "found.jsonl").read_text("utf-8").splitlines()) == 1


def record(fault: str, new: float, value: float, **more: Any) -> dict[str, Any]:
    """A record of a campaign whose truth is 10, with an interval of ±1."""
    row = {"name": "Z8", "truth": 10.0, "value": value, "lower": value - 1.0, "upper": value + 1.0}
    errors = {"step +1 V": new, "step -1 V": 0.0, "stair": 0.0, "sine 0.5 Hz": 0.0, "chirp": 0.0}
    entries = {"axis": "hoist", "rate": 512.0, "seed": 0, "unseen": False, "exit": 0}
    verdict = {"unsound": [], "causes": [], "check": [], "new": errors, "estimates": [row]}
    verdict |= {"guilty": [], "blamed": []}
    return entries | verdict | {"fault": fault} | more


def campaign_record(seed: int, current: bool, new: float, **more: Any) -> dict[str, Any]:
    """A record of the bench of intervals: ten estimates of 10, with the ends 9 and 11."""
    row = {"truth": 10.0, "as_read": 10.0, "value": 10.0, "lower": 9.0, "upper": 11.0}
    rows = [{**row, "name": f"Z{n}", "told": n % 2 == 0} for n in range(10)]
    rows[1]["truth"] = rows[2]["truth"] = 12.0
    names = ("step +1 V", "step -1 V", "stair", "sine 0.5 Hz", "chirp")
    group = {"axis": "hoist", "current": current, "prior": 0.3, "stated_spread": 0.06}
    entries = {"rate": 512.0, "seed": seed, "exit": 0, "unsound": [], "blamed": [], "causes": []}
    found = {"estimates": rows, "new": dict.fromkeys(names, 0.1) | {"chirp": new}}
    measures = {"cpu_init": 1.0, "cpu_fit": 2.0, "memory": 3.0, "stated": 0.5}
    return group | entries | found | measures | {"hysteresis": None} | more


def test_intervals_that_the_tests_tell_are_counted_apart(calibration: ModuleType) -> None:
    records = [campaign_record(0, True, 0.2), campaign_record(1, True, 0.4, exit=1)]
    ((group, some),) = calibration.groups(records).items()
    cells = dict(zip(calibration.OVERVIEW, calibration.overview_row(group, some), strict=True))
    assert cells["exit codes"] == "0 (1), 1 (1)"
    assert (cells["intervals"], cells["that the tests tell"]) == (20, 10)
    assert cells["hold the truth"].startswith("80.0%")
    assert cells["of these hold"].startswith("80.0%")
    assert cells["by campaign"] == "80% to 80%"
    assert cells["half width, median %"] == "10"


def test_how_narrow_an_interval_of_a_prior_is(calibration: ModuleType, tmp_path: Path) -> None:
    """95 % of a log-normal prior of 30 % lie between exp(-0.588) and exp(0.588) of the nominal."""
    from command_line import is_told, prior_spreads

    assert is_told(0.76, 1.34, 0.3)  # ln 1.34/0.76 = 0.567
    assert not is_told(0.74, 1.34, 0.3)  # 0.594
    assert is_told(-1.34, -0.76, 0.3)
    assert not is_told(-0.1, 1.0, 0.3)
    assert not is_told(0.9, None, 0.3)
    text = "free = { J = { spread = 0.3 }, Z1 = { relative = [0.5, 2.0] } }\n"
    (tmp_path / "setup.toml").write_text(text)
    assert prior_spreads(tmp_path / "setup.toml") == {"J": 0.3}
    assert prior_spreads(tmp_path / "none.toml") == {}


def test_bands_are_counted_by_maneuver(calibration: ModuleType) -> None:
    bands = [
        [{"maneuver": "chirp", "true": 0.2, "band": 0.5, "inside": 1.0}],
        [{"maneuver": "chirp", "true": 0.4, "band": 0.2, "inside": 0.5}],
        [],
    ]
    records = [campaign_record(n, True, 0.2, bands=some) for n, some in enumerate(bands)]
    ((group, some),) = calibration.groups(records).items()
    cells = calibration.band_row(group, some)[len(calibration.GROUP) :]
    assert cells == ("-", "-", "-", "-", "1 of 2, 1.5, 75 %")


def test_statements_are_those_of_maneuvers(calibration: ModuleType) -> None:
    """Of two classes by their samples; a faster sine has a statement of its own."""
    rows = [
        {"maneuver": "stair", "samples": 300, "printed": 1.0, "true": 2.0, "faster": None},
        {"maneuver": "stair", "samples": 100, "printed": 3.0, "true": 0.0, "faster": None},
        {"maneuver": "stair", "samples": 900, "printed": None, "true": 9.0, "faster": None},
        {"maneuver": "sine 0.5 Hz", "samples": 10, "printed": 1.0, "true": 2.0, "faster": 6.0},
        {"maneuver": "chirp", "samples": 10, "printed": 1.0, "true": 4.0, "faster": None},
    ]
    one = campaign_record(0, True, 0.2, statements=rows)
    found = {each.maneuver: each for each in calibration.statements(one)}
    # (300 · 1 + 100 · 9) / 400 = 3, and (300 · 4) / 400 = 3
    assert found["stair"][2:] == pytest.approx((3.0**0.5, 3.0**0.5, False))
    assert found["sine 0.5 Hz"][2:] == (6.0, 2.0, True)
    ((group, some),) = calibration.groups([one]).items()
    assert calibration.statement_row(group, some)[-3:] == ("1 of 2, 0.62", "1 of 1, 3", 1)


def test_errors_with_and_without_an_ammeter(calibration: ModuleType) -> None:
    """Of seeds that have both."""
    pairs = [(0.2, 0.4), (0.4, 0.4), (1.0, 3.0)]
    records = [campaign_record(9, True, 9.0)]
    for seed, (with_one, without) in enumerate(pairs):
        records += [campaign_record(seed, True, with_one), campaign_record(seed, False, without)]
    ((axis, *_, campaigns, with_one, without, ratio, usual),) = calibration.instrument_rows(
        calibration.groups(records)
    )
    assert (axis, campaigns, with_one, without) == ("hoist", 3, "0.4", "0.4")
    assert (ratio, usual) == ("1", "2")


def test_false_alarms_of_sound_campaigns(calibration: ModuleType) -> None:
    own = {"causes": ["solenoid_hysteresis"], "hysteresis": 4e-4, "own_hysteresis": 3.5e-4}
    records = [
        campaign_record(0, True, 0.2, **own),
        campaign_record(1, True, 0.2, causes=["tau"]),
        campaign_record(2, True, 0.2, unsound=["a run"], blamed=["hoist_step"]),
    ]
    ((group, some),) = calibration.groups(records).items()
    row = calibration.alarm_row(group, some)
    assert row[-5:] == (3, 2, 1, "tau (1)", "hoist_step (2)")


def test_sound_runs_that_are_blamed_beside_the_guilty_one(bench: ModuleType) -> None:
    late = record("one run late by 0.2 s", 0.0, 10.0, guilty=["sine"], blamed=["ramp", "sine"])
    assert bench.wrongly_blamed(late) == ["ramp"]
    assert bench.wrongly_blamed(record("none", 0.0, 10.0, blamed=["ramp"])) == ["ramp"]
    # in every run
    assert not bench.wrongly_blamed(record("ammeter clipped", 0.0, 10.0, blamed=["ramp"]))


def test_classes_are_beyond_the_sound_campaign(bench: ModuleType) -> None:
    sound = record("none", 2.0, 11.5)
    faulty = [
        record("spool friction", 4.9, 12.0),
        record("spool friction", 5.1, 12.0),
        record("spool friction", 2.0, 14.6),
        record("encoder reads 3 % too much", 9.0, 20.0, unseen=True),
        record("spool friction", 9.0, 20.0, seed=1),  # without a sound one
    ]
    rows = bench.judged([sound, *faulty])
    assert [row["class"] for row in rows] == ["C", "C", "B", "B", "A"]
    assert rows[2]["beyond"] == pytest.approx((3.1, 0.5))


def test_where_a_verdict_names_a_fault(bench: ModuleType) -> None:
    friction = record("spool friction", 0.0, 10.0, causes=["tau", "solenoid_hysteresis"])
    assert bench.named(friction) == "cause"
    loss = ["loss of speed under a load that pulls one way, encoder_counts"]
    assert (
        bench.named(record("leakage under load, 2 % of the top speed", 0.0, 10.0, causes=loss))
        == ""
    )
    loss = ["loss of speed under a load that resists, encoder_counts"]
    assert bench.named(record("leakage under load, 2 % of the top speed", 0.0, 10.0, causes=loss))
    assert bench.named(record("spool friction", 0.0, 10.0, causes=loss)) == ""
    assert bench.named(record("none", 0.0, 10.0, causes=loss)) == ""
    hidden = record("supply pressure 20 % low", 0.0, 10.0, assumed=["the fixed Z6, Z9 as stated"])
    assert bench.named(hidden) == "assumed"
    found = ["hoist_ramp_+1_V-s: 'encoder_counts' is 6.1 times as far from the simulation."]
    assert bench.named(record("run of another axis", 0.0, 10.0, unsound=found)) == "unsound"
    found = ["hoist_step_+4_V: 'encoder_counts' is 6.1 times as far from the simulation."]
    assert bench.named(record("run of another axis", 0.0, 10.0, unsound=found)) == ""


def test_a_hysteresis_that_the_machine_has_is_a_right_cause(bench: ModuleType) -> None:
    found = {"causes": ["solenoid_hysteresis"], "hysteresis": 4e-4}
    sound = record("none", 0.0, 10.0, own_hysteresis=3.5e-4, **found)
    assert bench.is_right(sound)
    assert not bench.is_right(record("none", 0.0, 10.0, own_hysteresis=1e-4, **found))
    assert not bench.is_right(record("none", 0.0, 10.0, causes=["tau"], own_hysteresis=4e-4))


def test_what_verdicts_say_is_counted(bench: ModuleType) -> None:
    """Two campaigns: three statements of 2, 1 and 0.4 times the true error, and one cause right."""
    errors = [(2.0, 1.0), (1.0, 1.0), (0.4, 1.0), (None, 1.0)]
    statements = [{"stated": stated, "true": true} for stated, true in errors]
    rows = [
        record("spool friction", 0.0, 10.0, causes=["solenoid_hysteresis"], statements=statements),
        record("spool friction", 0.0, 10.0, causes=["tau"], exit=1),
        record("spool friction", 0.0, 10.0, unsound=["refused"], exit=2),
    ]
    cells = dict(zip(bench.VERDICTS, bench.verdict_cells(rows), strict=True))
    assert cells == {
        "campaigns": 3,
        "exit code": "0 (1), 1 (1), 2 (1)",
        "unsound": 1,
        "cause named": 2,
        "right": 1,
        "wrong": 1,
        "statements": 3,
        "hold, %": "66.7",
        "stated over true, median": "1.00",
        "below half, %": "33.3",
    }


@pytest.mark.slow
def test_errors_are_stated_by_class_under_the_days_conditions(
    bench: ModuleType, tmp_path: Path
) -> None:
    """A fit that is the machine of the first half of the day, and a speed that has halved since."""
    from second_machine import draws

    sound = draws.drawn_equipment("hoist", 1000)
    runs = list(sound.conditions)
    speeds = dict.fromkeys(runs, draws.STEADY)
    speeds |= dict.fromkeys(runs[len(runs) // 2 :], draws.STEADY._replace(speed=0.5))
    machine = Drive.preset("hoist").parameters.numbers
    numbers = {name: machine[name] for name in sound.parameters}
    equipment = replace(sound, parameters=numbers, conditions=speeds)
    (tmp_path / "fitted").mkdir()
    (tmp_path / "logs").mkdir()
    Drive.preset("hoist").to_toml(tmp_path / "fitted" / "drive.toml")
    (tmp_path / "logs" / "run.csv").write_text("time [s],voltage [V]\n0.0,9.0\n0.1,-8.0\n")
    entry = {
        "channel": "encoder_counts",
        "unit": "rad/s",
        "reach": 6.0,
        "coefficients": [0.02**2, 0.0, 0.0],
        "classes": [["large", 0.02, 3, 1], ["fast", 0.02, 3, 1]],
    }
    record = {"predictions": [entry], "decisive": ["encoder_counts", "rectified_current"]}
    rows = bench.in_new_maneuvers(tmp_path, equipment, record)
    assert len({(row["maneuver"], row["motion"]) for row in rows}) == len(rows)
    assert {row["stated"] for row in rows if row["motion"] == "small"} == {None}
    stated = [row["stated"] for row in rows if row["motion"] != "small"]
    assert stated == pytest.approx([2.0] * len(stated))
    assert {row["printed"] for row in rows if row["motion"] != "small"} == {2.0}
    assert {row["faster"] for row in rows} == {None}
    worst: dict[str, float] = {}
    for row in rows:
        worst[row["maneuver"]] = max(row["true"], worst.get(row["maneuver"], 0.0))
    names = list(worst)
    assert names == ["step +1 V", "step -1 V", "stair", "sine 0.5 Hz", "chirp"]
    # 0.1 % is what two ways of marching one machine differ by
    assert max(worst[name] for name in names[:2]) < 0.1
    # half of a speed whose RMS is more than a tenth of the range
    assert min(worst[name] for name in names[3:]) > 100.0 * 0.5 * 0.1


def test_bench_goes_on_where_it_stopped(bench: ModuleType, tmp_path: Path) -> None:
    """A line for each campaign; what has one is not run again; an error of a command is a line."""
    items = [{"fault": "none", "seed": seed} for seed in range(3)]
    seen: list[int] = []

    def work(item: dict[str, Any], _: Path) -> dict[str, Any]:
        seen.append(item["seed"])
        if item["seed"] == 1:
            raise bench.CampaignError("no drive")
        return {"exit": 0}

    path = tmp_path / "records.jsonl"
    bench.run_missing(work, bench.missing(items[:2], bench.read(path)), 1, path)
    bench.run_missing(work, bench.missing(items, bench.read(path)), 1, path)
    assert seen == [0, 1, 2]
    assert bench.read(path) == [
        {"fault": "none", "seed": 0, "exit": 0},
        {"fault": "none", "seed": 1, "error": "no drive"},
        {"fault": "none", "seed": 2, "exit": 0},
    ]


@pytest.mark.slow
def test_faults_go_from_logs_to_a_table(bench: ModuleType, tmp_path: Path) -> None:
    """A sound campaign and a faulty one of slew: drafted, checked, fitted, predicted, judged."""
    done = subprocess.run(
        [
            sys.executable,
            str(BENCHMARKS / "faults.py"),
            *("--axis", "slew", "--fault", "none", "encoder reads 3 % too much"),
            *("--rate", "50", "--campaigns", "1", "--sound", "1", "--development"),
            *("--jobs", "1", "--out", "found.jsonl", "--judged", "judged.jsonl"),
        ],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    rows = [
        json.loads(line) for line in (tmp_path / "judged.jsonl").read_text("utf-8").splitlines()
    ]
    assert [row["class"] for row in rows] == ["C", "A"]
    assert all(len(row["new"]) == 5 for row in rows)
    for row in rows:
        assert row["usable"] == (row["exit"] == 0)
        assert row["headline"].startswith("Usable: " if row["usable"] else "Not usable")
        assert {each["maneuver"] for each in row["statements"]} == set(row["new"])
        assert {"channel", "reach", "coefficients", "classes"} <= set(row["predictions"][0])
    # the fit lies between the encoder, which sees a faster drum, and the tacho
    errors = [row["new"]["stair"] for row in rows]
    assert errors[1] > 1.2 * errors[0]
    assert not rows[0]["causes"]
    assert {"scale of encoder_counts", "scale of shaft_speed"} <= set(rows[1]["causes"])
    # no fit sees the scale of one, but that it is not that of the other
    assert bench.named(rows[1]) == "cause"
    assert "| encoder reads 3 % too much | slew | A |" in done.stdout
    assert "| sound | 1 | 0 |" in done.stdout
