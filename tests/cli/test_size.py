import re

import numpy as np
import pytest

from swashplate import Drive
from swashplate.analysis import performance, pulled


def test_speed_and_acceleration(done, number, tmp_path):
    words = ("--speed-deg-s", "200", "--acceleration-deg-s2", "200", "--out", "larger.toml")
    text = done("size", "hoist", *words)
    # both go with the pump, the acceleration with the orifice too
    assert number(text, "pump") == pytest.approx(1.2094, abs=2e-3)
    assert number(text, "orifice") == pytest.approx(1.2094, abs=2e-3)
    (line,) = [line for line in text.splitlines() if line.startswith("acceleration")]
    assert line.split()[:3] == ["acceleration", ">=", "200.00"]
    assert "See it over a command: swashplate whatif hoist --scale orifice=1.2" in text
    pump = Drive.from_toml(tmp_path / "larger.toml")["Z10"].value
    assert pump == pytest.approx(12.396 * 1.2094, rel=2e-3)


def test_a_tracking_error(done, number):
    words = ("--tracking-deg-s", "18", "--maneuver", "sine:9,0.1", "--lever", "pump=1/1.5")
    text = done("size", "hoist", *words)
    assert 1.0 < number(text, "pump") < 1.5
    (line,) = [line for line in text.splitlines() if line.startswith("tracking error")]
    assert line.split()[2:4] == ["<=", "18.00"]


@pytest.mark.parametrize("wanted", [150.0, 200.0, 220.0])
@pytest.mark.parametrize("levers", [("orifice",), ("pump",), ("orifice", "pump")])
def test_the_command_that_is_proposed_is_enough(done, wanted, levers):
    words = [word for lever in levers for word in ("--lever", lever)]
    text = done("size", "hoist", "--acceleration-deg-s2", f"{wanted:g}", *words)
    given = dict(re.findall(r"--scale (\w+)=([\d.]+)", text))
    assert set(given) == set(levers)
    assert all(len(factor) <= 7 for factor in given.values())
    changed = pulled(Drive.preset("hoist"), {name: float(each) for name, each in given.items()})
    assert np.degrees(performance(changed).acceleration) >= wanted


def test_nothing_to_change(done):
    text = done("size", "hoist", "--speed-deg-s", "190", "--direction", "positive")
    assert "nothing needs to be changed" in text


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "Require at least one of a speed"),
        (("--speed-deg-s", "500"), "the hoist reaches a speed of 370 deg/s (required 500)"),
        (("--speed-deg-s", "-5"), "must be positive"),
        (("--tracking-deg-s", "5"), "--tracking-deg-s and --maneuver belong together"),
        (("--speed-deg-s", "250", "--maneuver", "step:9"), "belong together"),
        (("--speed-deg-s", "250", "--lever", "pomp"), "no lever 'pomp' (did you mean pump?)"),
        (("--speed-deg-s", "250", "--lever", "pump=1.2/2"), "must reach from at most 1"),
    ],
)
def test_refusals(refused, words, said):
    assert said in refused("size", "hoist", *words)
