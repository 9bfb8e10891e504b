import numpy as np
import polars as pl
import pytest

from swashplate import Drive


def rows(text: str) -> dict[str, list[str]]:
    """The table's rows by amplitude."""
    body = text.partition("─\n")[2].strip("\n").split("\n\n")[0]
    return {line.split()[0]: line.split()[1:] for line in body.splitlines()}


def test_gain_and_phase_at_0_3_hz(done):
    text = done("bode", "hoist", "--points", "5")
    assert "hoist, sines about 0 V: 6 frequencies from 0.02 to 5 Hz" in text
    assert "At 0.3 Hz:" in text
    table = rows(text)
    assert list(table) == ["1", "4", "6.5", "9"]
    phases = [float(row[1]) for row in table.values()]
    assert phases == sorted(phases, reverse=True)
    assert phases[-1] < -50.0 < -20.0 < phases[0]
    for row in table.values():
        # 0.3 Hz: 108 degrees a second
        assert float(row[2]) == pytest.approx(-float(row[1]) / 108.0 * 1e3, abs=0.6)


def test_files(done, tmp_path):
    words = ("--amplitude", "0.1", "--amplitude", "1", "--bias", "3", "--points", "4")
    text = done("bode", "slew", *words, "--linear-at", "3", "--plot", "b.png", "--out", "b.csv")
    assert "Figure: b.png" in text
    assert "Gain, phase and distortion, in SI: b.csv" in text
    assert (tmp_path / "b.png").read_bytes().startswith(b"\x89PNG")
    table = pl.read_csv("b.csv")
    assert table.height == 2 * 5
    f = np.unique(np.append(np.geomspace(0.02, 5.0, 4), 0.3))
    expected = Drive.preset("slew").frequency_response(f, [0.1, 1.0], bias=3.0)
    np.testing.assert_allclose(table["gain"], expected.gain.ravel())


def test_an_amplitude_that_moves_nothing(done):
    text = done("bode", "hoist", "--amplitude", "0.05", "--amplitude", "2", "--points", "3")
    assert rows(text)["0.05"][0] == "none"


def test_a_changed_drive_and_another_frequency(done):
    text = done("bode", "hoist", "--scale", "Z16=2", "--frequency", "0.1", "--points", "3")
    assert "Z16" in text
    assert "At 0.1 Hz:" in text


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--points", "1"), "--points is 1, but must be 2 to 2000"),
        (("--from", "2", "--to", "1"), "must rise from above 0 Hz, not 2 to 1"),
        (("--from", "nan"), "must rise from above 0 Hz"),
        (("--to", "100"), "at most 64 Hz"),
        (("--amplitude", "11"), "reach 11 V"),
        (("--amplitude", "0.05"), "nothing moves about 0 V"),
        (("--linear-at", "0"), "so the gain is 0; linearise at +0.2065 V or beyond."),
        (("--frequency", "nan"), "The frequencies must be one or more finite numbers"),
        (("--points", "3", "--out", "bode.txt"), "a table is written as .csv or .parquet"),
        (("--points", "3", "--plot", "none/bode.png"), "cannot be written"),
    ],
)
def test_refusals(refused, words, said):
    assert said in refused("bode", "hoist", *words)
