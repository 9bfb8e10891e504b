"""The benches behind the tables of the documentation: they run on the package as it is."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


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
