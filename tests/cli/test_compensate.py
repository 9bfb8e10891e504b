import numpy as np
import polars as pl
import pytest

from swashplate import Drive
from swashplate.analysis import InverseMap


def test_the_map_that_is_printed(done):
    text = done("compensate", "hoist", "--speed-deg-s", "97.75", "--speed-deg-s", "-22.16")
    assert "hoist: voltage for a wanted speed" in text
    rows = dict(pair for line in text.splitlines() if len(pair := line.split()) == 2)
    # the static table: 97.75 deg/s at 4 V, -22.16 at -1 V
    assert float(rows["97.75"]) == pytest.approx(4.0, abs=5e-4)
    assert float(rows["-22.16"]) == pytest.approx(-1.0, abs=5e-4)
    assert float(rows["195.997"]) == pytest.approx(7.87, abs=0.005)
    assert float(rows["-184.996"]) == pytest.approx(-7.41, abs=0.005)
    assert "11 of 203 points shown" in text  # five of 101 each way, and 0 V
    assert "points shown" not in done("compensate", "hoist", "--points", "5")


def test_the_improvement(done, number):
    text = done("compensate", "slew", "sine:2,0.1")
    plain, mapped, led = (
        number(text, name) for name in ("straight line", "inverse map", "inverse map and lead")
    )
    assert plain > mapped > led
    assert "Error of the speed under sine 2 V 0.1 Hz" in text


def test_files(done, tmp_path):
    text = done("compensate", "luff", "--out", "luff.toml", "--plot", "luff.png", "--points", "21")
    assert "Inverse map, in SI: luff.toml" in text
    inverse = InverseMap.from_toml("luff.toml")
    assert inverse.plus.speed.size == 21
    luff = Drive.preset("luff")
    assert luff.steady_speed(float(inverse.voltage(1.0))) == pytest.approx(1.0, abs=1e-5)
    assert (tmp_path / "luff.png").read_bytes().startswith(b"\x89PNG")
    done("compensate", "luff", "step:2", "--out", "luff.csv", "--plot", "bought.png")
    table = pl.read_csv("luff.csv")
    assert table.height == 203
    assert np.degrees(table["speed"].max()) == pytest.approx(148.63, abs=0.01)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("hoist", "--speed-deg-s", "200"), "hoist cannot settle at 200 deg/s"),
        (("hoist", "--speed-deg-s", "nan"), "must be finite"),
        (("hoist", "--points", "1"), "takes 2 to 10001 points each way, not 1"),
        (("hoist", "--set", "Z17=5"), "No positive command up to 10 V moves hoist"),
        (("hoist", "step:11"), "The voltage is 11 V"),
        (("slew", "rest:2"), "asks for nothing but standstill"),
        (("hoist", "--out", "map.txt"), "written as .toml, .csv or .parquet"),
        (("hoist", "--plot", "map.bmp"), "a figure is written as .png"),
    ],
)
def test_refusals(refused, words, said):
    assert said in refused("compensate", *words)
