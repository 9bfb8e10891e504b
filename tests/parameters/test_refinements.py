"""Refinements in parameter sets: off unless given, with units, rules and files."""

import copy
import pickle
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np
import pytest

from swashplate import Drive, ParameterError
from swashplate.parameters import CATALOGUE, REFINEMENTS

FILE = """
[refinements]
spool_friction = { value = 0.115, unit = "N", status = "assumed", source = "step of 4 V" }
spool_presliding = { value = 0.05, unit = "mm", status = "assumed" }
dither_time = { value = 600, unit = "ms", status = "assumed", bounds = [100, 2000] }
load_torque = { value = 30, unit = "kN m", status = "assumed" }
"""


def test_published_sets_and_their_files_have_none(axis: Drive, tmp_path: Path) -> None:
    assert list(axis.parameters) == list(CATALOGUE)
    assert axis.parameters.refinements == ()
    assert REFINEMENTS.keys().isdisjoint(axis.parameters.numbers)
    assert "spool_friction" not in axis.parameters
    off = axis["spool_friction"]
    assert (off.value, off.status, off.unit) == (0.0, "inactive", "N")
    assert axis["dither_time"].value == inf
    assert axis["cam_cycles"].value == 5.5
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
    assert drive["dither_time"].own_bounds == pytest.approx((0.1, 2.0))
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


def test_what_is_on_is_said_and_not_guessed(hoist: Drive, tmp_path: Path) -> None:
    """A set can have a refinement's values and leave it off; a file says so."""
    drive = hoist.replace(cam_ripple=0.02, Z12=0.1, solenoid_hysteresis=0.01)
    assert drive.parameters.options == {"ripple", "loaded", "hysteresis"}
    parked = Drive(replace(drive.parameters, options=frozenset({"ripple", "leaky"})))
    assert parked.parameters.refinements == ("cam_ripple",)
    assert parked["solenoid_hysteresis"].value == 0.01
    assert parked.plain.parameters.options == {"leaky"}
    assert parked != drive
    assert pickle.loads(pickle.dumps(parked)) == parked
    for each in (drive, parked):
        each.to_toml(tmp_path / "set.toml")
        assert Drive.from_toml(tmp_path / "set.toml") == each
    assert 'options = ["leaky", "ripple"]' in (tmp_path / "set.toml").read_text("utf-8")
    without = drive.replace(solenoid_hysteresis=0.0, Z12=0.0)
    voltage = np.linspace(0.0, 4.0, 300)
    plain = without.simulate(voltage).shaft_speed
    loose = Drive(replace(parked.parameters, options=frozenset({"ripple"})))
    assert np.array_equal(loose.simulate(voltage).shaft_speed, plain)


def test_values_that_change_take_their_own_option_along(hoist: Drive) -> None:
    both = hoist.replace(cam_ripple=0.02, cam_ripple_per_torque=1e-6, load_torque=1e4)
    assert both.replace(cam_ripple=0.0).parameters.options == {"ripple"}
    assert both.replace(cam_ripple=0.0, cam_ripple_per_torque=0.0).parameters.options == set()
    fixed = both.parameters.with_numbers({"Z12": 0.1, "cam_ripple": 0.0}, both.parameters.options)
    assert fixed.options == {"ripple"}


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"stiction"}, "option 'stiction'.* leaky, loaded, friction"),
        ({"friction"}, "friction .* spool_friction .* 0; .* 1e-07 N"),
        ({"ripple"}, "ripple .* cam_ripple and cam_ripple_per_torque .* 0"),
    ],
)
def test_options_without_a_size_are_refused(hoist: Drive, options: set[str], sentence: str) -> None:
    with pytest.raises(ParameterError, match=sentence):
        replace(hoist.parameters, options=frozenset(options))


def test_the_cards_filter_is_the_recursion_where_a_rate_says_so(
    axis: Drive, tmp_path: Path
) -> None:
    assert axis.parameters.rate == 512.0
    assert Drive.preset("neutral").parameters.rate is None
    axis.to_toml(tmp_path / "set.toml")
    text = (tmp_path / "set.toml").read_text("utf-8")
    assert "rate = 512.0" in text
    (tmp_path / "set.toml").write_text(text.replace("rate = 512.0\n", ""), "utf-8")
    assert Drive.from_toml(tmp_path / "set.toml").parameters.rate is None
