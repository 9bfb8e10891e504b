"""Progress: what is logged, what a person who waits is shown, and that scripts print nothing."""

import logging
import os
import subprocess
import sys
from io import StringIO
from pathlib import Path

import pytest
from tests.identification.given import FEW, virtual

from swashplate import Drive, maneuvers, progress
from swashplate.identification import Search, fit

TESTS = [maneuvers.step(volts, stop=3.0, length=4.0) for volts in (4.0, -5.0)]


class Lines:
    """A display that keeps its lines."""

    def __init__(self) -> None:
        self.shown: list[str] = []
        self.ended: list[str] = []

    def show(self, line: str) -> None:
        self.shown.append(line)

    def end(self, work: progress.Work) -> None:
        self.ended.append(work.activity)


def test_work_is_logged_and_shown_from_its_beginning_to_its_end(caplog) -> None:
    lines = Lines()
    with caplog.at_level(logging.INFO, "swashplate"), progress.shown_by(lines):
        with progress.working("Fitting hoist"), progress.working("Searching") as search:
            search.at("evaluation 3")
            search.at("evaluation 4")  # too soon after the last
        with pytest.raises(ZeroDivisionError), progress.working("Judging"):
            raise ZeroDivisionError
    assert lines.shown[:2] == ["Fitting hoist", "Fitting hoist: searching"]
    assert "Fitting hoist: searching: evaluation 4" not in lines.shown
    assert lines.shown[-1] == "Judging"
    assert lines.ended == ["Fitting hoist", "Judging"]
    said = [record.getMessage() for record in caplog.records]
    assert said[:2] == ["Fitting hoist", "Searching"]
    assert [line.partition(":")[0] for line in said[2:]] == [
        "Searching",
        "Fitting hoist",
        "Judging",
        "Judging",
    ]


def test_work_that_never_ended_is_not_shown_for_ever() -> None:
    lines = Lines()
    with progress.shown_by(lines):
        with progress.working("Fitting hoist"):
            progress.begin("Compiling")  # a compiler that fails does not say so
        with progress.working("Judging"):
            pass
    assert lines.shown == ["Fitting hoist", "Fitting hoist: compiling", "Judging"]
    assert len(lines.ended) == 2


def test_items_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "OFTEN", 0.0)
    lines = Lines()
    with progress.shown_by(lines):
        assert list(progress.counted("abc", 3, "runs", "Validating")) == ["a", "b", "c"]
    assert lines.shown[1:] == [f"Validating: {done} of 3 runs" for done in (1, 2, 3)]


def test_a_prompt_gets_one_line_that_is_wiped_out(capsys, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "20")
    line = progress.TerminalLine()
    line.show("Fitting hoist: searching")
    line.show("Judging")
    line.end(progress.Work("Judging"))
    first, second, last = capsys.readouterr().err.split("\r")[1:4]
    assert first == "Fitting hoist: sea…"
    assert second == f"{'Judging':19}"
    assert not last.strip()


class Terminal(StringIO):
    def isatty(self) -> bool:
        return True


def test_a_script_shows_a_line_on_a_terminal_only_and_not_beside_the_log(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def written(stream: StringIO) -> str:
        monkeypatch.setattr(sys, "stderr", stream)
        with progress.working("Judging"):
            pass
        return stream.getvalue()

    assert written(Terminal()) == f"\rJudging\r{'':7}\r"
    assert written(StringIO()) == ""
    caplog.set_level(logging.INFO, "swashplate")
    assert written(Terminal()) == ""


def test_a_fit_says_its_evaluations_and_cost(tmp_path: Path, caplog) -> None:
    campaign = virtual(tmp_path, "hoist", TESTS, seed=1)
    lines = Lines()
    with caplog.at_level(logging.INFO, "swashplate"), progress.shown_by(lines):
        fitted = fit(Drive.preset("hoist"), campaign, FEW, search=Search(0))
    solution = fitted.solution
    said = f"after {solution.evaluations} evaluations, cost {solution.cost:.5g}"
    assert f"Search: {solution.message} {said}" in caplog.messages
    assert "Fitting hoist: searching" in lines.shown
    assert len(lines.ended) == 1


SCRIPT = """
import sys
import swashplate
if "log" in sys.argv:
    import logging
    logging.basicConfig(level=logging.INFO)
swashplate.Drive.preset("hoist").simulate(swashplate.maneuvers.parse("step:9"))
"""


@pytest.mark.slow  # compiles a drive in a process of its own
def test_compiling_is_said_once_a_machine_and_only_to_who_asks(tmp_path: Path) -> None:
    def errors(*words: str, cache: str) -> str:
        place = os.environ | {"SWASHPLATE_CACHE_DIR": str(tmp_path / cache)}
        command = [sys.executable, "-c", SCRIPT, *words]
        done = subprocess.run(command, env=place, capture_output=True, text=True, check=True)
        assert not done.stdout
        return done.stderr

    assert errors(cache="first") == ""
    assert "once on this machine: drive_march" in errors("log", cache="second")
    assert "once on this machine" not in errors("log", cache="second")
