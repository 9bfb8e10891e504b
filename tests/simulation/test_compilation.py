"""Machine code of a drive's march: used when nothing changed, never when an equation did."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import swashplate

SCRIPT = """
import numpy as np
from swashplate import Drive
from swashplate.equations.marching.run import march_kernel
run = Drive.preset("hoist").simulate_current(np.full(60, 0.5))
print(run.shaft_speed[-1])
march = march_kernel(run.instance.model, (run.driven_by,), run.instance.options, run.kept)
print(sum(march.stats.cache_hits.values()), sum(march.stats.cache_misses.values()))
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy of the package that a test may change."""
    source = Path(swashplate.__file__).parent
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(source, tmp_path / "src" / "swashplate", ignore=ignore)
    return tmp_path / "src" / "swashplate"


def run(package: Path) -> tuple[float, int, int]:
    environment = {
        **os.environ,
        "PYTHONPATH": str(package.parent),
        "NUMBA_CACHE_DIR": str(package.parent.parent / "cache"),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True
    )
    speed, hits, misses = done.stdout.split()
    return float(speed), int(hits), int(misses)


def test_a_changed_equation_is_never_answered_from_the_cache(package: Path) -> None:
    speed, hits, misses = run(package)
    assert (hits, misses) == (0, 1)
    assert run(package) == (speed, 1, 0)

    # an equation that the march inlines changes, at the same length and with the same time stamp,
    # which is all that Numba itself would look at
    component = package / "models" / "pump.py"
    stat = component.stat()
    text = component.read_text("utf-8")
    assert "gain = 0.25 * Z8 * h" in text
    component.write_text(text.replace("gain = 0.25 * Z8 * h", "gain = 0.24 * Z8 * h"))
    os.utime(component, ns=(stat.st_atime_ns, stat.st_mtime_ns))

    slower, hits, misses = run(package)
    assert (hits, misses) == (0, 1)
    assert slower < 0.99 * speed
