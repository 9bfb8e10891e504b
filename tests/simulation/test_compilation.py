"""Machine code of a drive's march: used when nothing changed, never when an equation did."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import swashplate

pytestmark = pytest.mark.slow

SCRIPT = """
import numpy as np
from swashplate import Drive
from swashplate.equations.marching.march import output_of
from swashplate.equations.marching.run import march_of
from swashplate.simulation.result import KEPT
run = Drive.preset("hoist").simulate_current(np.full(60, 0.5))
print(run.shaft_speed[-1])
kept = tuple(output_of(run.instance.model, name)[0] for name in KEPT)
march = march_of(run.instance.model, (run.driven_by,), run.instance.options, kept)()
print(march.cache_hits)
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy of the package that a test may change."""
    source = Path(swashplate.__file__).parent
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(source, tmp_path / "src" / "swashplate", ignore=ignore)
    return tmp_path / "src" / "swashplate"


def run(package: Path) -> tuple[float, int]:
    environment = {
        **os.environ,
        "PYTHONPATH": str(package.parent),
        "NUMBA_CACHE_DIR": str(package.parent.parent / "cache"),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True
    )
    speed, hits = done.stdout.split()
    return float(speed), int(hits)


def test_a_changed_equation_is_never_answered_from_the_cache(package: Path) -> None:
    speed, hits = run(package)
    assert hits == 0
    assert run(package) == (speed, 1)

    # an equation that the march inlines changes, at the same length and with the same time stamp,
    # which is all that Numba itself would look at
    component = package / "models" / "displacement_control.py"
    stat = component.stat()
    text = component.read_text("utf-8")
    assert "gain = 0.25 * Z8 * h" in text
    component.write_text(text.replace("gain = 0.25 * Z8 * h", "gain = 0.24 * Z8 * h"))
    os.utime(component, ns=(stat.st_atime_ns, stat.st_mtime_ns))

    slower, hits = run(package)
    assert hits == 0
    assert slower < 0.99 * speed
