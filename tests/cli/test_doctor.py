"""`swashplate doctor` tells what is installed, and whether it gives the published speed."""

import tomllib
from importlib import metadata
from pathlib import Path

import pytest

from swashplate import __version__
from swashplate.cli import doctor

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8"))


def test_it_prints_versions_extras_cache_and_a_simulated_speed(run) -> None:
    done = run("doctor")
    assert done.exit_code == 0, done.output
    words = " ".join(done.stdout.split())
    assert f"swashplate {__version__}" in words
    assert f"numba {metadata.version('numba')}" in words
    assert "196.0 deg/s, as published" in words
    assert "Compiled kernels:" in words or "cannot be kept" in words


def test_its_extras_are_those_of_the_package() -> None:
    extras = PROJECT["project"]["optional-dependencies"]
    named = {each.name: each.library.lower() for each in doctor.EXTRAS}
    assert set(named) == set(extras) - {"dev"}
    for name, library in named.items():
        assert [each.split(">")[0].lower() for each in extras[name]] == [library]


def test_an_extra_that_is_missing_has_no_version(run, monkeypatch: pytest.MonkeyPatch) -> None:
    there = metadata.version

    def version(library: str) -> str:
        if library == "npTDMS":
            raise metadata.PackageNotFoundError(library)
        return there(library)

    monkeypatch.setattr(doctor.metadata, "version", version)
    lines = [line.split() for line in run("doctor").stdout.splitlines()]
    assert ["tdms", "-", "logs", "in", "National", "Instruments'", "TDMS"] in lines


def test_a_wrong_speed_is_said_and_ends_with_code_1(run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "_simulated", lambda: (150.0, 0.1))
    done = run("doctor")
    assert done.exit_code == 1
    assert "150.0 deg/s, but 196.0 deg/s is published" in " ".join(done.stdout.split())
