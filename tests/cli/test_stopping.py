"""Every command ends when it is told to: at once, alone, and without a trace of half its work."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tests.cli.conftest import freeing, without_resource_warnings
from tests.marks import rest_slow

from swashplate.stopping import GRACE

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="sends signals of POSIX")

SETUP = freeing("J omega_plus Z8 Z16")
COMMAND = [sys.executable, "-m", "swashplate"]
PROMPT = 5.0
"""Within which a command must have ended. [s]"""
FIT = "fit virtual/campaign.toml --setup setup.toml --out fitted --jobs {jobs}"
COMMANDS = {
    "guess": "guess virtual/campaign.toml --out start.toml --force",
    "fit": f"{FIT} --profile all",
    "starts": f"{FIT} --starts 6",
    "validate": "validate hoist virtual/campaign.toml --role all --out validation",
}
AFTER = (0.3, 2.0, 4.0, 6.0, 9.0)
"""Into imports, search, intervals, causes and report of a fit. [s]"""
DEAF = {
    "swallowed by a finaliser": """
class Careless:
    def __del__(self):
        while True:
            time.sleep(0.01)

Careless()
""",
    "in C": "import hashlib; hashlib.pbkdf2_hmac('sha256', b'', b'', 60_000_000)",
    "waits for threads": """
from concurrent.futures import ThreadPoolExecutor

with ThreadPoolExecutor(1) as pool:
    pool.submit(time.sleep, 20.0)
    time.sleep(20.0)
""",
}


def told(process: subprocess.Popen[str], how: signal.Signals, *, group: bool) -> float:
    """Send a signal as a terminal does, or as a batch system; seconds until the process ends."""
    begin = time.monotonic()
    (os.killpg if group else os.kill)(process.pid, how)
    process.wait(30.0)
    return time.monotonic() - begin


def members(group: int) -> list[str]:
    """Live processes of a group."""
    found = subprocess.run(["ps", "-eo", "pgid=,stat=,args="], capture_output=True, text=True)
    fields = [line.split(maxsplit=2) for line in found.stdout.splitlines()]
    return [each[-1] for each in fields if each[0] == str(group) and "Z" not in each[1]]


def check_stopped(words: list[str], cwd: Path, after: float, how: signal.Signals) -> None:
    process = subprocess.Popen(
        words,
        cwd=cwd,
        env=without_resource_warnings(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    time.sleep(after)
    if process.poll() is not None:
        process.communicate()
        pytest.skip("it had ended before")
    seconds = told(process, how, group=how == signal.SIGINT)
    # Python's tracker of semaphores ends a moment after those that it serves
    until = time.monotonic() + 1.0
    while members(process.pid) and time.monotonic() < until:
        time.sleep(0.05)
    assert members(process.pid) == []
    _, warnings = process.communicate(timeout=10.0)
    if process.returncode == 0 and seconds < 0.5:
        # its work was whole before the signal: there is nothing to see of how it stops
        pytest.skip("it was ending by itself")
    assert process.returncode == 128 + how, warnings
    assert seconds < PROMPT
    assert warnings == ""
    files = [path for path in cwd.rglob("*") if path.is_file()]
    assert [path for path in files if path.name.startswith(".")] == []
    written = {path.name for path in (cwd / "fitted").glob("*.*")}
    assert not written or {"drive.toml", "fit.json", "setup.toml"} <= written


@pytest.fixture
def virtual_tests(virtual: Path, tmp_path: Path) -> Path:
    """A folder with the folder virtual and a fit setup."""
    (tmp_path / "setup.toml").write_text(SETUP, "utf-8")
    return tmp_path


@pytest.mark.parametrize("how", rest_slow([signal.SIGINT, signal.SIGTERM]))
def test_a_fit_ends_when_told(virtual_tests: Path, how: signal.Signals) -> None:
    words = COMMANDS["starts"].format(jobs=2).split()
    check_stopped([*COMMAND, *words], virtual_tests, 2.5, how)


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    ("name", "jobs", "after"),
    [
        *((name, 1, after) for name in ("guess", "validate") for after in (0.3, 1.5, 3.0)),
        *((name, jobs, after) for name in ("fit", "starts") for jobs in (1, 2) for after in AFTER),
    ],
)
def test_every_phase_ends_when_told(
    virtual_tests: Path, how: signal.Signals, name: str, jobs: int, after: float
) -> None:
    words = COMMANDS[name].format(jobs=jobs).split()
    check_stopped([*COMMAND, *words], virtual_tests, after, how)


@pytest.mark.parametrize("program", rest_slow([*DEAF.values()]), ids=DEAF)
def test_a_program_that_does_not_hear_is_ended_from_outside(tmp_path: Path, program: str) -> None:
    """With what it leaves half written."""
    half = tmp_path / ".half"
    lines = [
        "import time",
        "from pathlib import Path",
        "from swashplate.stopping import obeying, undone",
        f"half = Path({str(half)!r})",
        "with obeying(), undone(half.unlink):",
        "    half.touch()",
        "    try:",
        *(f"        {line}" for line in program.splitlines()),
        "    finally:",
        "        half.unlink(missing_ok=True)",
    ]
    process = subprocess.Popen(
        [sys.executable, "-c", "\n".join(lines)], stderr=subprocess.PIPE, text=True
    )
    while not half.exists():
        time.sleep(0.01)
    time.sleep(0.2)
    assert told(process, signal.SIGINT, group=False) < GRACE + 1.5
    assert process.returncode == 128 + signal.SIGINT
    assert process.communicate()[1] == ""
    assert not half.exists()
