"""Errors are a SwashplateError, and what Python itself has a word for."""

import pickle
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

import swashplate
from swashplate import Campaign, Drive, Identification, PhysicalSet, SwashplateError, maneuvers
from swashplate.errors import (
    DomainError,
    FileError,
    InputError,
    InputTypeError,
    MissingFileError,
    ParameterError,
    UnknownNameError,
    UnknownParameterError,
    UnsoundDataError,
)
from swashplate.identification import ModelSetup, load_setup
from swashplate.logs import open_log

MISSING: Mapping[str, Callable[[Path], object]] = {
    "drive": lambda folder: Drive.from_toml(folder / "nothing.toml"),
    "fit's drive": lambda folder: Drive.from_toml(folder),
    "campaign": lambda folder: Campaign.from_toml(folder / "nothing.toml"),
    "log": lambda folder: open_log(folder / "nothing.csv"),
    "fit setup": lambda folder: load_setup(folder / "nothing.toml"),
    "fit": lambda folder: Identification.load(folder),
    "identify": lambda folder: swashplate.identify(folder / "nothing.toml"),
    "model": lambda folder: ModelSetup.from_file(folder / "nothing.py"),
}


@pytest.mark.parametrize("read", MISSING.values(), ids=MISSING)
def test_a_missing_file_is_pythons_too(read: Callable[[Path], object], tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError) as caught:
        read(tmp_path)
    assert isinstance(caught.value, SwashplateError)
    assert isinstance(caught.value, FileError)
    assert tmp_path.name in str(caught.value)


def test_a_file_that_is_there_but_cannot_be_read_is_an_os_error(tmp_path: Path) -> None:
    (tmp_path / "drive.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(OSError, match=r"drive\.toml .*UTF-8") as caught:
        Drive.from_toml(tmp_path)
    assert not isinstance(caught.value, FileNotFoundError)
    with pytest.raises(OSError, match=r"/no\b"):
        Drive.preset("hoist").to_toml(tmp_path / "no" / "drive.toml")


KEYS: Mapping[str, Callable[[], object]] = {
    "Z99": lambda: Drive.preset("hoist")["Z99"],
    "Z98": lambda: Drive.preset("hoist").parameters["Z98"],
    "shaft_sped": lambda: Drive.preset("hoist").simulate(maneuvers.rest(1.0))["shaft_sped"],
    "oil": lambda: PhysicalSet.preset("hoist")["oil"],
}


@pytest.mark.parametrize(("key", "ask"), KEYS.items(), ids=KEYS)
def test_a_missing_key_is_pythons_too(key: str, ask: Callable[[], object]) -> None:
    with pytest.raises(KeyError) as caught:
        ask()
    assert isinstance(caught.value, SwashplateError)
    # a sentence, not the quoted text of a KeyError
    assert f"'{key}'" in str(caught.value)
    assert not str(caught.value).startswith(("'", '"'))


@pytest.mark.parametrize(
    "kind",
    [
        DomainError,
        FileError,
        InputError,
        InputTypeError,
        MissingFileError,
        ParameterError,
        UnknownNameError,
        UnknownParameterError,
        UnsoundDataError,
    ],
)
def test_an_error_comes_back_from_another_process(kind: type[SwashplateError]) -> None:
    error = kind("There is no parameter 'Z99'.")
    assert type(kind.__new__(kind, *error.args)) is kind  # as libraries of clusters make it again
    back = pickle.loads(pickle.dumps(error))
    assert type(back) is kind
    assert isinstance(back, ValueError)
    assert str(back) == str(error) == "There is no parameter 'Z99'."
