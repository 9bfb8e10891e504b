"""The real record, end to end; needs the excavator's logs beside the checkout."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data" / "excavator"


@pytest.mark.skipif(not DATA.exists(), reason="the excavator's logs are not beside this checkout")
def test_another_operators_trial_is_predicted(tmp_path: Path) -> None:
    figure = tmp_path / "boom.png"
    done = subprocess.run(
        [sys.executable, ROOT / "examples" / "excavator.py", DATA, "--figure", figure],
        capture_output=True,
        text=True,
        check=True,
    )
    found = dict(line.split() for line in done.stdout.splitlines()[:6])
    # what is known of this machine: dead zones of 0.6-1.5 % duty or less, a delay near 0.1 s
    assert 0.3 < float(found["V_dz_minus"]) < float(found["V_dz_plus"]) < 1.5
    assert 0.03 < float(found["tau"]) < 0.15
    *_, rmse, _, _, moved, _ = done.stdout.splitlines()[-1].split()
    # the band that nine-parameter models of this kind reach on other operators' trials
    assert 1.8 < float(rmse) < 4.5
    assert float(moved) > 8.0
    assert figure.stat().st_size > 10_000


def test_it_is_short() -> None:
    lines = (ROOT / "examples" / "excavator.py").read_text("utf-8").splitlines()
    assert len(lines) < 100
