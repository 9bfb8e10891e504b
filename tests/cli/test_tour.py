from io import StringIO

import polars as pl
import pytest
from rich.console import Console

from swashplate.maneuvers import source_tests
from swashplate.parameters.files import AXES


@pytest.fixture
def printed(done):
    return done("tour", "--out", "sub/tour")


def test_every_run_is_written_and_listed(printed, tmp_path):
    folder = tmp_path / "sub/tour"
    names = {
        f"{axis}/{name.replace('/', ' per ')}.csv" for axis in AXES for name in source_tests(axis)
    }
    figures = {"overview.png", "steady.png"}
    written = {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()}
    assert written == names | figures
    assert len(names) == 25
    assert pl.read_csv(folder / "hoist/step +9 V.csv").height == 5121
    assert {"hoist/ramp -1 V per s.csv", "slew/sine 6 V 0.05 Hz.csv"} <= names
    (row,) = [line for line in printed.splitlines() if line.startswith("hoist  step +9 V ")]
    assert row.split()[4:7] == ["5121", "196.00", "0.00"]
    assert "swash stop" in printed
    for figure in figures:
        assert (folder / figure).read_bytes().startswith(b"\x89PNG")
        assert f"sub/tour/{figure}" in printed
    assert max(map(len, printed.splitlines())) <= 80


def test_a_person_who_waits_sees_a_bar(run, monkeypatch):
    terminal = Console(file=StringIO(), force_terminal=True, width=80, markup=False)
    monkeypatch.setattr("swashplate.cli.terminal.side", terminal)
    assert run("tour").exit_code == 0
    seen = terminal.file.getvalue()
    assert "0/27" in seen
    assert "hoist, ramp +1 V/s" in seen
    assert seen.endswith("\x1b[?25h\r\x1b[1A\x1b[2K")  # the bar is wiped out, the cursor is back


def test_a_folder_that_cannot_be_made(refused, tmp_path):
    (tmp_path / "file").write_text("")
    assert "file/hoist cannot be made: Not a directory" in refused("tour", "--out", "file")
