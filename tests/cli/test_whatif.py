import numpy as np
import pytest

from swashplate import Drive
from swashplate.analysis import monte_carlo

BOTH = ("--scale", "orifice=1.5", "--scale", "pump=1.5")


def test_figure_9_1(done, number, tmp_path):
    words = ("--plot", "w.png", "--out", "larger.toml")
    text = done("whatif", "hoist", *BOTH, "--maneuver", "sine:9,0.1", *words)
    assert "hoist, sine 9 V 0.1 Hz" in text
    assert "Z10 (swash plate angle to shaft speed): 12.396 -> 18.594 1/s" in text
    assert number(text, "speed limit, positive") == 196.00
    assert number(text, "speed limit, positive", 1) == pytest.approx(294.0, abs=0.05)
    assert number(text, "speed limit, negative", 1) == pytest.approx(-277.5, abs=0.05)
    assert "+50.0 %" in text
    assert (tmp_path / "w.png").read_bytes().startswith(b"\x89PNG")
    assert Drive.from_toml(tmp_path / "larger.toml")["Z10"].value == pytest.approx(18.594)


def test_the_levers_are_listed(done):
    text = done("whatif", "--levers")
    for word in ("orifice _plus _minus", "drive_speed", "rate_limit_down", "Z16 by its square"):
        assert word in text


def test_bands(done, tmp_path, monkeypatch):
    drawn = monte_carlo.independent_drives(Drive.preset("hoist"), {"Z10": 0.12396}, 50)
    monkeypatch.setattr(monte_carlo, "stored_draws", lambda *_, **__: drawn)
    words = ("--uncertainty", "fitted", "--draws", "50", "--plot", "w.svg")
    text = done("whatif", "hoist", "--scale", "pump=1.5", "--maneuver", "step:9", *words)
    (line,) = [line for line in text.splitlines() if line.startswith("final speed")]
    # one per cent of 196 deg/s, about twice that each way
    assert float(line.split()[3]) == pytest.approx(3.8, abs=1.2)
    assert float(line.split()[5]) == pytest.approx(1.5 * float(line.split()[3]), abs=0.02)
    (limit,) = [line for line in text.splitlines() if line.startswith("speed limit, positive")]
    assert limit.split()[3:7] == line.split()[2:6]  # 9 V reaches the stop
    assert "Band of 50 drives, changed: at most" in text
    assert "Correlations ignored" in text
    assert (tmp_path / "w.svg").exists()


def test_an_outcome_that_is_not(done):
    words = ("--maneuver", "step:0.05", "--scale", "pump=1.1")
    text = done("whatif", "slew", *words)
    assert "- as it is: no rise_time, the shaft stands still" in text


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--scale", "orifise=1.5"), "There is no lever 'orifise' (did you mean orifice?)"),
        (("--scale", "orifice"), "--scale cannot read 'orifice'; write it as orifice=1.5"),
        (("--scale", "pump=1", "--scale", "pump=2"), "--scale gives pump twice"),
        (("--scale", "pump=-1"), "The factor on pump is -1, but must be 0 or more"),
        (("--scale", "pump=0"), "Z10"),
        (("--scale", "pump=2", "--maneuver", "hop:1"), "hop"),
        (("--scale", "pump=2", "--rate", "1"), "The rate is 1 Hz"),
        (("--scale", "pump=2", "--uncertainty", "none"), "none holds no fit.json"),
        (("--scale", "pump=2", "--uncertainty", "x", "--draws", "3"), "bands need 20 or more"),
        (("--scale", "pump=2", "--plot", "none/w.png"), "cannot be written"),
        (("--scale", "pump=2", "--plot", "w.txt"), "a figure is written as .png, .svg or .pdf"),
    ],
)
def test_refusals(refused, words, said):
    assert said in refused("whatif", "hoist", *words)


def test_degrees_at_the_edge(done, number):
    """The table's speed is the run's, in degrees."""
    text = done("whatif", "luff", "--scale", "pump=1.2", "--maneuver", "step:9")
    expected = np.degrees(Drive.preset("luff").steady_speed(9.0))
    assert number(text, "final speed") == pytest.approx(expected, abs=0.02)


def test_a_log_is_a_command_like_a_manoeuvre(done, tmp_path, number):
    """A step to 6 V at 2 s, held until the next row, as the manoeuvre would be."""
    rows = "\n".join(f"{t / 512},{6000 if 512 * 2 <= t < 512 * 5 else 0}" for t in range(512 * 8))
    (tmp_path / "log.csv").write_text(f"time [s],stick [mV]\n{rows}\n")
    words = ("--scale", "orifice=1.5", "--column", "stick", "--interpolation", "linear")
    text = done("whatif", "hoist", "--maneuver", "log.csv", *words)
    assert "hoist, log.csv" in text
    assert "±" not in text  # no bands were asked for
    same = done("whatif", "hoist", "--maneuver", "step:6,start=2,stop=5,length=8", *words[:2])
    for outcome in ("final speed", "rise time", "tracking error", "travel"):
        assert number(text, outcome) == pytest.approx(number(same, outcome), rel=2e-3)
