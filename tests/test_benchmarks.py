"""The benches behind the tables of the documentation: they run on the package as it is."""

import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


@pytest.mark.slow
def test_calibration_compares_its_methods(tmp_path: Path) -> None:
    """One campaign, all methods: rows for each, and a table."""
    words = ["--axes", "hoist", "--campaigns", "1", "--cells", "0", "--methods", "--jobs", "1"]
    done = subprocess.run(
        [sys.executable, str(BENCHMARKS / "calibration.py"), *words, "--out", "found.csv"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "1 campaigns in" in done.stdout
    written = (tmp_path / "found.csv").read_text("utf-8")
    for method in ("white noise", "band-score sandwich", "larger of smoothed spectrum"):
        assert method in written
