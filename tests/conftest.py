"""What many tests need: derivatives by differences, the drives, Kruse's numbers."""

import os
import signal
import tomllib
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

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
ALONE = (
    "test_benchmarks.py",
    "test_pages.py",
    "test_site.py",
    "test_scripts.py",
    "test_recovery.py",
)
"""Files whose slow tests have nothing in common that takes long to make, the slowest first."""


def group_of(test: str, *, slow: bool) -> str:
    """What a test shares a worker with, by its name ``folder/file.py::name``.

    Of what needs the same kernels none is compiled twice, and no fit that several tests look at is
    made twice. `slow`: whether only slow tests run.
    """
    path = Path(test.partition("::")[0])
    folder, file = path.parent.name, path.name
    if slow and file in ALONE:
        return test
    if folder == "crane" or file in CRANE_FILES:
        return "crane"
    if folder in ("drive", "linear") or file == "test_stepping.py":
        return "steppers"
    return folder if folder == "reproduction" else file


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Give each group to one worker.

    Not by marks ``xdist_group``: they go by names that pytest 9.2 no longer lets xdist 3.8 change,
    so that they are ignored without a word.
    """
    from xdist.scheduler import LoadScopeScheduling

    class Groups(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return group_of(nodeid, slow=config.option.markexpr == "slow")

    config.option.loadscopereorder = False
    return Groups(config, log)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave slow folders out of a quick run: to collect them takes seconds of each worker."""
    named = any(Path(each).resolve().is_relative_to(collection_path) for each in config.args)
    if collection_path.name in SLOW and config.option.markexpr == "not slow" and not named:
        return True
    return None


@pytest.hookimpl(tryfirst=True)  # before tests are left out by their marks
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what lies in a slow folder as slow, and begin with what takes longest.

    So no worker waits for it at the end.
    """
    for item in items:
        if item.path.parent.name in SLOW:
            item.add_marker(pytest.mark.slow)
    slow = config.option.markexpr == "slow"
    groups = {item: group_of(item.nodeid, slow=slow) for item in items}
    sizes = Counter(groups.values())

    def place(item: pytest.Item) -> tuple[int, int, str]:
        file = item.path.name
        first = ALONE.index(file) if slow and file in ALONE else len(ALONE)
        return first, -sizes[groups[item]], groups[item]

    items.sort(key=place)


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
