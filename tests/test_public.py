"""What ``import swashplate`` gives, and what it costs."""

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import swashplate

SUBMODULES = (
    "analysis",
    "campaign",
    "crane",
    "drafting",
    "drive",
    "export",
    "full_order",
    "identification",
    "logs",
    "machine",
    "maneuvers",
    "models",
    "parameters",
    "report",
    "rig",
)


def fresh(program: str) -> str:
    """What a program prints in a Python of its own."""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


@pytest.mark.parametrize("name", SUBMODULES)
def test_submodules_are_attributes(name: str) -> None:
    assert name in swashplate.__all__
    assert name in dir(swashplate)
    assert fresh(f"import swashplate; print(swashplate.{name}.__name__)") == f"swashplate.{name}"


@pytest.mark.slow
def test_figures_and_reports_are_attributes_of_report() -> None:
    program = "import swashplate as sp; print(sp.report.figures.plot_bode.__name__)"
    assert fresh(program) == "plot_bode"


def test_every_public_name_is_there() -> None:
    for name in swashplate.__all__:
        assert getattr(swashplate, name) is not None
    for name in SUBMODULES:
        module = import_module(f"swashplate.{name}")
        assert all(hasattr(module, each) for each in getattr(module, "__all__", ()))


def test_the_import_loads_no_library() -> None:
    """It takes a few milliseconds: names and submodules are loaded when they are used."""
    program = "import sys; before = set(sys.modules); import swashplate; "
    program += "print(*sorted({m.partition('.')[0] for m in set(sys.modules) - before}))"
    loaded = set(fresh(program).split())
    assert "swashplate" in loaded
    assert loaded <= {"swashplate", "lazy_loader", *sys.stdlib_module_names}


@pytest.mark.slow
def test_nobody_pays_for_plotting_who_does_not_plot() -> None:
    """Results name matplotlib's types; only figures import it."""
    program = """
import importlib, pkgutil, sys
import swashplate
for module in pkgutil.walk_packages(swashplate.__path__, "swashplate."):
    if not module.name.startswith(("swashplate.report", "swashplate.__main__")):
        importlib.import_module(module.name)
print("swashplate.crane" in sys.modules, "matplotlib" in sys.modules)
"""
    assert fresh(program) == "True False"


SCRIPT = """
from pathlib import Path

import numpy as np
from typing import assert_type
import swashplate
from swashplate import Campaign, Drive, Identification, maneuvers
from swashplate.identification import Verdict

result = swashplate.identify("campaign.toml", "hoist", {"Z8": (0.5, 2.0)}, starts=5)
assert_type(result, Identification)
assert_type(result.drive, Drive)
assert_type(result.verdict, Verdict)
assert_type(result["Z8"].value, float)
assert_type(result["Z8"].standard_error, float | None)
assert_type(result["Z8"].interval, tuple[float | None, float | None])
assert_type(result.save("fitted"), tuple[Path, ...])
swashplate.identify(Campaign.from_toml("x"), Drive.preset("hoist"), Path("mine.toml"))
assert_type(Identification.load("fitted"), Identification)
assert_type(swashplate.crane.Crane, type[swashplate.crane.Crane])
hoist = Drive.preset("hoist")
assert_type("Z16" in hoist, bool)
run = hoist.simulate(maneuvers.step(9.0))
run.to_pandas(units="display")
run.to_pandas(units="bar")  # ERROR
swashplate.identify(3)  # ERROR
swashplate.identify("campaign.toml", start=5)  # ERROR
"""


@pytest.mark.slow
def test_the_types_are_exact(tmp_path: Path) -> None:
    """A script in strict mode: what is right passes, each line marked ERROR does not."""
    pytest.importorskip("mypy")
    (tmp_path / "script.py").write_text(SCRIPT, "utf-8")
    command = [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", "script.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    wrong = {int(line.split(":")[1]) for line in done.stdout.splitlines() if ": error:" in line}
    lines = SCRIPT.splitlines()
    assert wrong == {k for k, line in enumerate(lines, 1) if "ERROR" in line}, done.stdout
