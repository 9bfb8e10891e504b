"""No command writes onto what it reads, and none reads a cache that others can write to."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from tests.cli.conftest import freeing

from swashplate import parameters

LOG = "time,voltage\n0,0\n1,5\n2,5\n"


@pytest.mark.parametrize("target", ["log.csv", "./log.csv", "link.csv"])
def test_no_output_onto_an_input(refused, tmp_path: Path, target: str) -> None:
    log = tmp_path / "log.csv"
    log.write_text(LOG, "utf-8")
    (tmp_path / "link.csv").symlink_to(log)
    words = ("simulate", "hoist", "log.csv", "--interpolation", "linear")
    assert "is read by this command" in refused(*words, "--out", target, "--force")
    assert log.read_text("utf-8") == LOG


FOLDERS = {
    "a fit onto its start": "fit virtual/campaign.toml --from fitted/drive.toml --out fitted",
    "a fit onto its setup": "fit virtual/campaign.toml --setup fitted/setup.toml --out ./fitted",
    "the start by its folder": "fit virtual/campaign.toml --from fitted --out fitted",
    "a guess onto the campaign's drive": "guess virtual/campaign.toml",
    "a guess onto it by --out": "guess virtual/campaign.toml --out virtual",
    "C beside its drive": "export fitted/drive.toml --c fitted",
    "tests onto their truth": "rig virtual/truth --out virtual",
    "changes onto the fit": "whatif fitted --scale pump=1.2 --out fitted/drive.toml",
    "samples onto the fitted log": "report fitted --data virtual/log.csv",
    "samples onto it by the drive": "report fitted/drive.toml --data virtual/log.csv",
    "measures onto a log": "validate hoist virtual/campaign.toml --out virtual",
}


@pytest.mark.parametrize("words", FOLDERS.values(), ids=FOLDERS)
def test_no_folder_is_written_onto_an_input(refused, tmp_path: Path, words: str) -> None:
    """Nor onto what the campaign of a stored fit names."""
    campaign = """
[axes.hoist]
drive = "start.toml"
time = { column = "time" }
input = { column = "voltage" }
channels.speed = { kind = "shaft_speed", column = "speed" }
[[runs]]
file = "log.csv"
[[runs]]
file = "measures.csv"
"""
    drive = (Path(parameters.__file__).parent / "sets" / "hoist.toml").read_text("utf-8")
    files = {
        **dict.fromkeys(("virtual/log.csv", "virtual/measures.csv"), LOG),
        **dict.fromkeys(
            ("virtual/start.toml", "virtual/truth/drive.toml", "fitted/drive.toml"), drive
        ),
        "virtual/campaign.toml": campaign,
        "fitted/setup.toml": freeing("Z8"),
        "fitted/fit.json": '{"campaign": "../virtual/campaign.toml"}',
    }
    for name, text in files.items():
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, "utf-8")
    assert "is read by this command as" in refused(*words.split(), "--force")
    assert {name: (tmp_path / name).read_text("utf-8") for name in files} == files


def test_outputs_beside_inputs_are_written(done, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(LOG, "utf-8")
    words = ("simulate", "hoist", "log.csv", "--interpolation", "linear", "--out", "run.csv")
    for force in ((), ("--force",)):
        assert "run.csv" in done(*words, *force)
    for force in ((), ("--force",)):
        assert "C: " in done("export", "hoist", "--c", "source", *force)


@pytest.mark.skipif(sys.platform == "win32", reason="permissions of POSIX")
def test_a_cache_that_others_can_write_to_is_not_read(tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    cache.mkdir()
    cache.chmod(0o777)
    done = subprocess.run(
        [sys.executable, "-m", "swashplate", "doctor"],
        env={**os.environ, "SWASHPLATE_CACHE_DIR": str(cache), "PYTHONWARNINGS": "default"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert "every user can write to it" in " ".join(done.stdout.split())
    assert not list(cache.rglob("*.nbc"))
