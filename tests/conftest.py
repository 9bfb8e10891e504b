"""What many tests need: derivatives by differences, the drives, Kruse's numbers."""

import os
import signal
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from swashplate import Drive

settings.register_profile(
    "swashplate",
    derandomize=True,
    deadline=None,  # the first example of a component compiles it
    max_examples=50,
    suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow],
)
settings.load_profile("swashplate")

# Warnings are errors in the processes that tests start, too: filterwarnings sees this one alone.
os.environ.setdefault("PYTHONWARNINGS", "error")
# A shell that starts tests in the background makes them, and what they start, deaf to Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)


SLOW = {"docs", "examples", "reproduction"}
"""Folders whose tests run whole pages, notebooks and figures: `make test-slow`."""


CRANE_FILES = {"test_crane_pages.py", "test_earlier_files.py"}
"""Files of other folders that simulate a crane."""
ALONE = {
    "test_benchmarks.py",
    "test_pages.py",
    "test_recovery.py",
    "test_scripts.py",
    "test_site.py",
}
"""Files whose slow tests have nothing in common that takes long to make."""


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave slow folders out of a quick run: to collect them takes seconds of each worker."""
    named = any(Path(each).resolve().is_relative_to(collection_path) for each in config.args)
    if collection_path.name in SLOW and config.option.markexpr == "not slow" and not named:
        return True
    return None


@pytest.hookimpl(tryfirst=True)  # before the groups are read
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what lies in a slow folder as slow, and group what needs the same kernels.

    With ``--dist loadgroup`` a group is one worker's, so that no kernel is compiled twice, and no
    fit that several tests look at is made twice.
    """
    for item in items:
        folder, file = item.path.parent.name, item.path.name
        if folder in SLOW:
            item.add_marker(pytest.mark.slow)
        if file in ALONE and item.get_closest_marker("slow"):
            continue
        closes_loops = folder == "crane" or file in CRANE_FILES
        steps = folder in ("drive", "linear") or file == "test_stepping.py"
        group = "crane" if closes_loops else "steppers" if steps else file
        if folder == "reproduction":
            group = folder
        item.add_marker(pytest.mark.xdist_group(group))
    # the longest of those that are alone begin first: no worker waits for them at the end
    items.sort(key=lambda item: item.path.name != "test_benchmarks.py")


def richardson(function: Callable[..., float], at: Sequence[float], index: int, h: float) -> float:
    """Central difference by one argument, extrapolated once: error O(h⁴)."""

    def slope(step: float) -> float:
        above, below = list(at), list(at)
        above[index] += step
        below[index] -= step
        return (function(*above) - function(*below)) / (above[index] - below[index])

    return (4.0 * slope(0.5 * h) - slope(h)) / 3.0


@pytest.fixture(scope="session")
def derivative() -> Callable[..., float]:
    """Richardson-extrapolated central difference of a function by one of its arguments."""
    return richardson


@pytest.fixture(params=["hoist", "slew", "luff"])
def axis(request: pytest.FixtureRequest) -> Drive:
    """Each of Kruse's drives in turn."""
    return Drive.preset(request.param)


@pytest.fixture(scope="session")
def hoist() -> Drive:
    """The hoist drive."""
    return Drive.preset("hoist")


@pytest.fixture(scope="session")
def source_parameters() -> dict:
    """Kruse's tables as facts apart from the package."""
    path = Path(__file__).parent / "thesis" / "published.toml"
    return tomllib.loads(path.read_text("utf-8"))


@pytest.fixture(scope="session")
def source_text() -> str:
    """The source itself: others' work, which stays outside the project."""
    path = Path(__file__).parents[2] / "shared" / "spec" / "thesis.txt"
    if not path.exists():
        pytest.skip("Kruse's text is not beside this checkout, and may not be copied into it")
    return path.read_text("utf-8")
