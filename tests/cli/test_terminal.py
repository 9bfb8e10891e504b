"""What a person sees who waits for a command."""

import io

import pytest
from rich.console import Console

from swashplate import progress
from swashplate.cli import terminal


@pytest.fixture
def screen(monkeypatch: pytest.MonkeyPatch) -> io.StringIO:
    """What standard error shows, of a terminal of 80 columns."""
    file = io.StringIO()
    console = Console(file=file, force_terminal=True, width=80, markup=False, highlight=False)
    monkeypatch.setattr(terminal, "side", console)
    return file


def test_a_spinner_says_what_the_package_is_doing(screen: io.StringIO) -> None:
    with terminal.spinner("Judging") as status:
        assert status.status == "Judging ..."
        with progress.working("Fitting hoist"):
            work = progress.begin("Compiling equations, once on this machine", "drive_march")
            assert status.status == (
                "Fitting hoist: compiling equations, once on this machine: drive_march ..."
            )
            progress.end(work)
        assert status.status == "Fitting hoist ..."
    assert "Fitting hoist ..." in screen.getvalue()


def test_a_bar_says_it_too(screen: io.StringIO) -> None:
    with terminal.long_work("Fitting", 2) as begin:
        begin("testing the virtual hoist")
        begin("fitting the card")
        with progress.working("Fitting hoist"):
            pass
    assert "Fitting hoist" in screen.getvalue()


def test_a_pipe_gets_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    file = io.StringIO()
    monkeypatch.setattr(terminal, "side", Console(file=file, force_terminal=False))
    with terminal.spinner("Judging"), progress.working("Fitting hoist"):
        pass
    with terminal.long_work("Fitting"), progress.working("Fitting hoist"):
        pass
    assert file.getvalue() == ""
