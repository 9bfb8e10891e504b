"""No command writes onto what it reads, and none reads a cache that others can write to."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

LOG = "time,voltage\n0,0\n1,5\n2,5\n"


@pytest.mark.parametrize("target", ["log.csv", "./log.csv", "link.csv"])
def test_no_output_onto_an_input(refused, tmp_path: Path, target: str) -> None:
    log = tmp_path / "log.csv"
    log.write_text(LOG, "utf-8")
    (tmp_path / "link.csv").symlink_to(log)
    words = ("simulate", "hoist", "log.csv", "--interpolation", "linear")
    assert "is read by this command" in refused(*words, "--out", target, "--force")
    assert log.read_text("utf-8") == LOG


@pytest.mark.skipif(sys.platform == "win32", reason="permissions of POSIX")
def test_a_cache_that_others_can_write_to_is_not_read(tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    cache.mkdir()
    cache.chmod(0o777)
    done = subprocess.run(
        [sys.executable, "-m", "swashplate", "doctor"],
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache), "PYTHONWARNINGS": "default"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert "every user can write to it" in " ".join(done.stdout.split())
    assert not list(cache.rglob("*.nbc"))
