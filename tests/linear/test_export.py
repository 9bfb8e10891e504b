"""Models as SciPy's objects and as files."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
import scipy.signal

from swashplate import Drive, FileError, InputError

F = np.geomspace(0.01, 20.0, 30)
OUTPUTS = ("shaft_speed", "stroker_pressure", "current")


def of_scipy(system: scipy.signal.StateSpace, f: np.ndarray, row: int) -> np.ndarray:
    """A response that uses nothing but the object's matrices."""
    point = 2j * np.pi * f if system.dt is None else np.exp(2j * np.pi * f * system.dt)
    eye = np.eye(system.A.shape[0])
    return np.array(
        [
            (system.C @ np.linalg.solve(p * eye - system.A, system.B) + system.D)[row, 0]
            for p in point
        ]
    )


def test_without_delay(hoist: Drive) -> None:
    model = hoist.linearize(current=0.45, outputs=OUTPUTS[:2])
    expected, system = model.response(F), model.to_scipy()
    assert system.dt is None
    for row in range(2):
        np.testing.assert_allclose(of_scipy(system, F, row), expected[row], rtol=1e-9)
    late = hoist.linearize(4.0)
    without = late.response(F)[0] * np.exp(2j * np.pi * F * 0.014)
    np.testing.assert_allclose(of_scipy(late.to_scipy(without_delay=True), F, 0), without)
    with pytest.raises(InputError, match="has a delay of 0.014 s, which no state space holds"):
        late.to_scipy()


@pytest.mark.parametrize("rate", [100.0, 512.0])
def test_a_sampled_model_is_exact(axis: Drive, rate: float) -> None:
    model = axis.linearize(2.0, outputs=OUTPUTS).discrete(1.0 / rate)
    expected, system = model.response(F), model.to_scipy()
    assert system.dt == 1.0 / rate
    for row in range(3):
        np.testing.assert_allclose(of_scipy(system, F, row), expected[row], rtol=1e-8)


@pytest.mark.parametrize("ending", ["toml", "json"])
def test_files_hold_everything(hoist: Drive, tmp_path: Path, ending: str) -> None:
    model = hoist.linearize(4.0, outputs=OUTPUTS).discrete(1.0 / 512.0)
    path = tmp_path / f"model.{ending}"
    model.write(path)
    text = path.read_text("utf-8")
    read = tomllib.loads(text) if ending == "toml" else json.loads(text)
    for name in "ABCD":
        np.testing.assert_array_equal(read[name], getattr(model, name))
    assert read["drive"] == "hoist"
    assert read["kind"] == "sampled"
    assert read["sample_time"] == 1.0 / 512.0
    assert read["delay"] == 7.0 / 512.0
    assert read["input_unit"] == "V"
    assert read["output_units"] == ["rad/s", "Pa", "A"]
    assert read["operating_point"]["voltage"] == 4.0
    assert read["operating_point"]["shaft_speed"] == hoist.steady_speed(4.0)


def test_places_that_cannot_be_written(hoist: Drive, tmp_path: Path) -> None:
    model = hoist.linearize(4.0)
    with pytest.raises(FileError, match="is written as .toml or .json"):
        model.write(tmp_path / "model.mat")
    with pytest.raises(FileError, match="cannot be written"):
        model.write(tmp_path / "none" / "model.json")
