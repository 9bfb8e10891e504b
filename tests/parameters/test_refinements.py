"""Refinements in parameter sets: off unless given, with units, rules and files."""

import copy
import pickle
from math import inf
from pathlib import Path

import pytest

from swashplate import Drive, ParameterError
from swashplate.parameters.definitions import CATALOGUE, REFINEMENTS

FILE = """
[refinements]
spool_friction = { value = 0.115, unit = "N", status = "assumed", source = "step of 4 V" }
spool_presliding = { value = 0.05, unit = "mm", status = "assumed" }
dither_time = { value = 600, unit = "ms", status = "assumed", bounds = [100, 2000] }
load_torque = { value = 30, unit = "kN m", status = "assumed" }
"""


def test_published_sets_have_none(axis: Drive) -> None:
    assert list(axis.parameters) == list(CATALOGUE)
    assert axis.parameters.refinements == ()
    assert REFINEMENTS.keys().isdisjoint(axis.parameters.numbers)
    assert "spool_friction" not in axis.parameters
    off = axis["spool_friction"]
    assert (off.value, off.status, off.unit) == (0.0, "inactive", "N")
    assert axis["dither_time"].value == inf
    assert axis["cam_cycles"].value == 5.5


def test_without_them_a_file_says_nothing_of_them(axis: Drive, tmp_path: Path) -> None:
    axis.to_toml(tmp_path / "set.toml")
    assert "refinements" not in (tmp_path / "set.toml").read_text("utf-8")


def test_a_file_may_have_them(hoist: Drive, tmp_path: Path) -> None:
    hoist.to_toml(tmp_path / "set.toml")
    text = (tmp_path / "set.toml").read_text("utf-8")
    (tmp_path / "set.toml").write_text(text + FILE, "utf-8")
    drive = Drive.from_toml(tmp_path / "set.toml")
    assert drive.parameters.refinements == ("spool_friction",)
    assert drive["spool_presliding"].value == pytest.approx(5e-5)
    assert drive["dither_time"].value == pytest.approx(0.6)
    assert drive["dither_time"].bounds == pytest.approx((0.1, 2.0))
    assert drive["load_torque"].value == pytest.approx(3e4)
    assert drive["spool_friction"].source == "step of 4 V"
    assert drive["spool_friction"].status == "assumed"
    drive.to_toml(tmp_path / "again.toml")
    assert Drive.from_toml(tmp_path / "again.toml") == drive
    assert drive.plain.parameters == hoist.parameters


def test_they_are_changed_like_all_others(hoist: Drive) -> None:
    drive = hoist.replace(spool_friction=0.1, dither_time=inf)
    assert drive["spool_friction"].value == 0.1
    assert drive["spool_friction"].status == "user"
    assert drive.scale(spool_friction=1.5)["spool_friction"].value == pytest.approx(0.15)
    assert drive.scale(cam_cycles=2.0)["cam_cycles"].value == 11.0  # from where it is off
    assert drive.replace(spool_friction=0.0).parameters.refinements == ()
    assert pickle.loads(pickle.dumps(drive)) == drive
    assert copy.deepcopy(drive) == drive
    assert drive != hoist


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"spool_friction": -0.1}, r"spool_friction .* is -0.1 N, but must be at least 0"),
        ({"spool_friction": (0.1, 0.2)}, "spool_friction has one value"),
        ({"dither_time": 0.0}, "dither_time .* must be above 0, or inf for none"),
        ({"spool_friction": 0.1, "dither_time": 0.6}, "spool_presliding is 0.* give that travel"),
        ({"line_stiffness": 1e6}, "line_stiffness is 1e.06 N m/rad, but load_inertia is 0: give"),
        ({"cam_ripple": 1.0}, "cam_ripple .* at least 0 and below 1"),
        (
            {"cam_ripple": 0.5, "cam_ripple_per_torque": 1e-5, "load_torque": -6e4},
            r"cam_ripple \+ cam_ripple_per_torque·\|load_torque\| is 1.1, but must be below 1",
        ),
        ({"spool_frction": 0.1}, "did you mean spool_friction"),
    ],
)
def test_broken_rules_are_sentences(hoist: Drive, changes: dict, sentence: str) -> None:
    with pytest.raises(ParameterError, match=sentence) as caught:
        hoist.replace(**changes)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("entry", "sentence"),
    [
        ('Z1 = { value = 1.0, unit = "1/Pa" }', r"\[refinements\] has no parameter 'Z1'"),
        ('spool_friction = { value = 1.0, unit = "m" }', "spool_friction"),
        ('spool_friction = { value = [0.1, 0.2], unit = "N" }', "has one value, not a plus and"),
        ('friction = { value = 1.0, unit = "N" }', "no parameter 'friction'"),
    ],
)
def test_wrong_entries_are_named(hoist: Drive, tmp_path: Path, entry: str, sentence: str) -> None:
    hoist.to_toml(tmp_path / "set.toml")
    text = (tmp_path / "set.toml").read_text("utf-8") + f"\n[refinements]\n{entry}\n"
    (tmp_path / "set.toml").write_text(text, "utf-8")
    with pytest.raises(ParameterError, match=sentence) as caught:
        Drive.from_toml(tmp_path / "set.toml")
    assert "set.toml" in str(caught.value)
    assert "\n" not in str(caught.value)
