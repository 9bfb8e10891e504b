import subprocess
import sys
from pathlib import Path

import pytest

from swashplate import FileError, Simulation
from swashplate.report.figures import plot_simulation, save_figure

SIGNATURES = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF", ".PNG": b"\x89PNG"}


@pytest.mark.parametrize("suffix", SIGNATURES)
def test_a_figure_is_written_whole_and_the_same_each_time(
    step: Simulation, tmp_path: Path, suffix: str
) -> None:
    first, second = tmp_path / f"first{suffix}", tmp_path / f"second{suffix}"
    save_figure(plot_simulation(step), first)
    save_figure(plot_simulation(step), str(second))
    content = first.read_bytes()
    assert content.startswith(SIGNATURES[suffix])
    assert content == second.read_bytes()
    assert not any(word in content for word in (b"<dc:date>", b"/CreationDate", b"tEXtCreation"))
    assert sorted(tmp_path.iterdir()) == [first, second]


@pytest.mark.parametrize("name", ["figure.jpg", "figure", "figure.svgz"])
def test_another_ending_is_refused(step: Simulation, tmp_path: Path, name: str) -> None:
    with pytest.raises(FileError, match=r"a figure is written as \.png, \.svg or \.pdf"):
        save_figure(plot_simulation(step), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_said(step: Simulation, tmp_path: Path) -> None:
    with pytest.raises(FileError, match="cannot be written"):
        save_figure(plot_simulation(step), tmp_path / "none" / "figure.png")


def test_an_older_file_stays_when_writing_fails(
    step: Simulation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = plot_simulation(step)
    path = tmp_path / "figure.png"
    path.write_bytes(b"older")

    def full(target: Path, **_: object) -> None:
        target.write_bytes(b"half a pic")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(figure, "savefig", full)
    with pytest.raises(FileError, match="No space left"):
        save_figure(figure, path)
    assert path.read_bytes() == b"older"
    assert list(tmp_path.iterdir()) == [path]


def test_plotting_touches_no_global_state() -> None:
    code = """
import sys
import matplotlib
from swashplate import Drive
from swashplate.report import figures

settings = [name for name in matplotlib.rcParams if name != "backend"]  # asking for it loads one
before = {name: matplotlib.rcParams[name] for name in settings}
figures.plot_simulation(Drive.preset("hoist").simulate([0.0, 1.0]))
assert "matplotlib.pyplot" not in sys.modules
assert {name: matplotlib.rcParams[name] for name in settings} == before
"""
    subprocess.run([sys.executable, "-c", code], check=True)
