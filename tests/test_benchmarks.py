"""The benches behind the tables of the documentation: they run on the package as it is."""

import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


@pytest.fixture(scope="module")
def bench() -> ModuleType:
    """The bench of faults as a module."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        import faults

        return faults


@pytest.mark.slow
def test_calibration_goes_from_logs_to_tables_and_goes_on(tmp_path: Path) -> None:
    """One campaign: drafted, fitted, predicted, counted; a second call does not run it again."""

    def run() -> str:
        done = subprocess.run(
            [
                sys.executable,
                str(BENCHMARKS / "calibration.py"),
                *("--axis", "luff", "--campaigns", "1", "--development", "--jobs", "1"),
                *("--out", "found.jsonl"),
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
    assert (record["axis"], record["seed"], record["rate"]) == ("luff", 1000, 512.0)
    rows = {row["name"]: row for row in record["estimates"]}
    assert {"V_dz_plus", "omega_plus", "Z8", "Z19_minus"} <= set(rows)
    assert rows["Z8"]["value"] == pytest.approx(rows["Z8"]["truth"], rel=0.2)
    assert len(record["new"]) == 5
    assert max(record["new"].values()) < 5.0
    assert "| luff | 512 | 1 (1000 to 1000) |" in first
    assert run() == first
    assert len((tmp_path / "found.jsonl").read_text("utf-8").splitlines()) == 1


def record(fault: str, new: float, value: float, **more: Any) -> dict[str, Any]:
    """A record of a campaign whose truth is 10, with an interval of ±1."""
    row = {"name": "Z8", "truth": 10.0, "value": value, "lower": value - 1.0, "upper": value + 1.0}
    errors = {"step +1 V": new, "step -1 V": 0.0, "stair": 0.0, "sine 0.5 Hz": 0.0, "chirp": 0.0}
    entries = {"axis": "hoist", "rate": 512.0, "seed": 0, "unseen": False, "grade": "Usable"}
    verdict = {"headline": "", "check": [], "new": errors, "estimates": [row]}
    return entries | verdict | {"fault": fault} | more


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


def test_causes_of_a_headline_and_whether_they_name_the_fault(bench: ModuleType) -> None:
    headline = (
        "Usable for prediction; values not to be trusted because residuals are 9.4 times their "
        "error (likely: one of these, which the residuals hardly tell apart: friction or "
        "hysteresis, as a lag of encoder_counts, by +0.348 deg/s explains 26 %; drift of "
        "encoder_counts over the campaign by -0.265 % explains 24 % of them)."
    )
    assert bench.causes(headline) == [
        "friction or hysteresis, as a lag of encoder_counts, by +0.348 deg/s",
        "drift of encoder_counts over the campaign by -0.265 %",
    ]
    assert bench.causes("Usable.") == []
    assert bench.named(record("spool friction", 0.0, 10.0, headline=headline)) == "verdict"
    hidden = record("supply pressure 20 % low", 0.0, 10.0, assumed=["in units of the fixed Z9."])
    assert bench.named(hidden) == "assumed"
    seen = record("run of another axis", 0.0, 10.0, check=["'counts' moves 6.1 times as far."])
    assert bench.named(seen) == "check"
    assert bench.named(record("ammeter clipped", 0.0, 10.0, headline=headline)) == ""


def test_bench_goes_on_where_it_stopped(bench: ModuleType, tmp_path: Path) -> None:
    """A line for each campaign; what has one is not run again; an error of a command is a line."""
    items = [{"fault": "none", "seed": seed} for seed in range(3)]
    seen: list[int] = []

    def work(item: dict[str, Any], _: Path) -> dict[str, Any]:
        seen.append(item["seed"])
        if item["seed"] == 1:
            raise bench.CampaignError("no drive")
        return {"grade": "Usable"}

    path = tmp_path / "records.jsonl"
    bench.run_missing(work, bench.missing(items[:2], bench.read(path)), 1, path)
    bench.run_missing(work, bench.missing(items, bench.read(path)), 1, path)
    assert seen == [0, 1, 2]
    assert bench.read(path) == [
        {"fault": "none", "seed": 0, "grade": "Usable"},
        {"fault": "none", "seed": 1, "error": "no drive"},
        {"fault": "none", "seed": 2, "grade": "Usable"},
    ]


@pytest.mark.slow
def test_faults_go_from_logs_to_a_table(tmp_path: Path) -> None:
    """A sound campaign and a faulty one of slew: drafted, checked, fitted, predicted, judged."""
    done = subprocess.run(
        [
            sys.executable,
            str(BENCHMARKS / "faults.py"),
            *("--axis", "slew", "--fault", "none", "encoder reads 3 % too much"),
            *("--campaigns", "1", "--sound", "1", "--development", "--jobs", "1"),
            *("--out", "found.jsonl", "--judged", "judged.jsonl"),
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
    # the fit takes the counts for a faster drum
    errors = [row["new"]["stair"] for row in rows]
    assert errors[1] - errors[0] > 0.5
    assert "| encoder reads 3 % too much | slew | A |" in done.stdout
