"""Sweeps against linear models, against textbook describing functions, against a simulation."""

from math import ceil

import numpy as np
import polars as pl
import pytest

from swashplate import DomainError, Drive, InputError
from swashplate.linear import response_table

F = (0.05, 0.3, 1.0, 5.0, 20.0)


@pytest.mark.parametrize("at", [-2.0, 3.0])
@pytest.mark.parametrize("name", ["hoist", "slew", "luff"])
def test_small_sines_agree_with_the_linear_model(name: str, at: float) -> None:
    drive = Drive.preset(name)
    model = drive.linearize(at, coulomb="tangent")
    amplitude = 1e-3
    swept = drive.frequency_response(F, [amplitude], bias=at, tolerance=1e-6)
    for frequency, ratio in zip(F, swept.ratio[0], strict=True):
        # the sweep's own step, with a whole number of them a cycle
        h = 1.0 / (frequency * ceil(512.0 / frequency))
        exact = model.discrete(h).response(frequency)[0]
        assert abs(ratio / exact - 1.0) < 1e-6
        # promised is 0.1 %; the continuous model is apart by the time of about one step
        continuous = model.response(frequency)[0]
        assert abs(ratio / continuous - 1.0) < 1.1 * 2.0 * np.pi * frequency * h
    assert (swept.distortion < 1e-3).all()
    np.testing.assert_allclose(swept.mean, drive.steady_speed(at), rtol=1e-5)


def test_the_coulomb_term_left_out_suits_larger_motions() -> None:
    slew = Drive.preset("slew")
    (ratio,) = slew.frequency_response([0.3], [1.0], bias=3.0).ratio[:, 0]
    errors = {
        coulomb: abs(ratio / slew.linearize(3.0, coulomb=coulomb).response(0.3)[0] - 1.0)
        for coulomb in ("ignored", "tangent")
    }
    assert errors["ignored"] < 0.02 < errors["tangent"]


@pytest.mark.parametrize(
    "output",
    [
        "swash_angle",
        "stroker_pressure",
        "orifice_opening",
        "spool_position",
        "solenoid_force",
        "current",
    ],
)
def test_every_output(hoist: Drive, output: str) -> None:
    swept = hoist.frequency_response([1.0], [1e-4], bias=4.0, output=output)
    model = hoist.linearize(4.0, outputs=[output]).discrete(1.0 / 512.0)
    assert swept.ratio[0, 0] == pytest.approx(model.response(1.0)[0], rel=1e-4)


def lagging(frequency: float) -> complex:
    """The neutral drive's lag of 0.1 s, so slow that its card hardly shows."""
    return 1.0 / (1.0 + 0.1 * 2j * np.pi * frequency)


def test_a_dead_zone() -> None:
    # N(A) = 1 - 2/π (asin d/A + d/A √(1 - (d/A)²)), in phase
    # the same gain by angles so small that tangents do not count
    drive = Drive.preset("neutral").replace(V_dz=1.0, G1=1.5e-5, Z10=1e5)
    amplitudes = np.array([0.9, 1.5, 2.0, 8.0])
    swept = drive.frequency_response([0.01], amplitudes)
    part = np.minimum(1.0 / amplitudes, 1.0)
    expected = 1.0 - 2.0 / np.pi * (np.arcsin(part) + part * np.sqrt(1.0 - part**2))
    np.testing.assert_allclose(swept.gain[:, 0], expected, atol=1e-4)
    assert swept.moves[:, 0].tolist() == [False, True, True, True]
    assert np.isnan(swept.phase[0, 0])
    # half a millivolt's worth of the lag, and two steps of the card
    np.testing.assert_allclose(swept.phase[1:, 0], np.angle(lagging(0.01)), atol=1e-3)


def test_a_stop() -> None:
    # saturation at d: N(A) = 2/π (asin d/A + d/A √(1 - (d/A)²)) for A > d
    drive = Drive.preset("neutral").replace(Z13=0.02)  # 100 rad/s a radian: stops at 2 rad/s
    amplitudes = np.array([1.0, 4.0, 9.0])
    swept = drive.frequency_response([0.005], amplitudes)
    part = np.minimum(2.0 / amplitudes, 1.0)
    expected = 2.0 / np.pi * (np.arcsin(part) + part * np.sqrt(1.0 - part**2))
    np.testing.assert_allclose(swept.gain[:, 0], expected, rtol=2e-3)


def test_the_phase_loss_at_0_3_hz(hoist: Drive) -> None:
    """What limits a swing controller: larger motions lag more, by the orifice."""
    swept = hoist.frequency_response([0.3], [1.0, 4.0, 6.5, 9.0])
    phase = np.degrees(swept.phase[:, 0])
    assert (np.diff(phase) < 0.0).all()
    assert phase[0] == pytest.approx(-17.2, abs=0.5)
    assert phase[-1] < -50.0
    # the same from a plain simulation at 512 Hz: 0.3 Hz repeats itself every 5120 samples
    n = np.arange(5 * 5120)
    turn = 2.0 * np.pi * 0.3 * n / 512.0
    run = hoist.simulate(9.0 * np.sin(turn))
    last = slice(-5120, None)
    harmonic = 2.0 / 5120.0 * np.sum(run.shaft_speed[last] * np.exp(-1j * turn[last])) * 1j / 9.0
    assert swept.ratio[-1, 0] == pytest.approx(harmonic, rel=1e-3)


def test_the_table_and_its_parts(hoist: Drive, tmp_path) -> None:
    swept = hoist.frequency_response([0.1, 0.3, 8.0], [0.25, 4.0])
    table = swept.to_polars()
    assert table.height == 6
    assert table["phase"].null_count() == int((~swept.moves).sum()) > 0
    assert table["amplitude"].to_list() == [0.25] * 3 + [4.0] * 3
    assert table["gain"].to_list()[4] == swept.gain[1, 1]
    swept.write(tmp_path / "bode.csv")
    assert pl.read_csv(tmp_path / "bode.csv").columns == table.columns
    with pytest.raises(InputError, match="not taken at 0.15 Hz; the nearest frequency is 0.1 Hz"):
        response_table(swept, 0.15)


def test_phases_are_followed(axis: Drive) -> None:
    f = np.geomspace(0.02, 8.0, 40)
    phase = axis.frequency_response(f, [0.5, 6.5], bias=0.0).phase
    for row in phase:
        there = row[np.isfinite(row)]
        assert np.abs(np.diff(there)).max() < np.pi
        assert (there < 0.05).all()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (([], [1.0]), "The frequencies must be one or more finite numbers above 0"),
        (([0.3, 0.2], [1.0]), "must rise from 0.001 Hz"),
        (([0.3, 100.0], [1.0]), "to at most 64 Hz"),
        (([1e-4], [1.0]), "must rise from 0.001 Hz"),
        (([0.3], [-1.0]), "The amplitudes must be"),
        (([0.3], ["x"]), "must be a sequence of numbers"),
        (([0.3], [11.0]), "reach 11 V, but the card takes ±10 V"),
        (([float("nan")], [1.0]), "finite numbers above 0"),
    ],
)
def test_refused_sines(hoist: Drive, arguments: tuple, said: str) -> None:
    with pytest.raises(InputError, match=said):
        hoist.frequency_response(*arguments)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"bias": 9.5}, "reach 10.5 V"),
        ({"bias": float("nan")}, "must be a finite number"),
        ({"input": "force"}, "it is 'voltage' or 'current'"),
        ({"output": "torque"}, "'torque' is no output of a sweep of the voltage"),
        ({"input": "current", "output": "current"}, "'current' is no output"),
        ({"rate": 100.0}, "between 512 and 100000 Hz"),
        ({"tolerance": 0.0}, "between 0 and 1"),
    ],
)
def test_refused_options(hoist: Drive, options: dict, said: str) -> None:
    with pytest.raises(InputError, match=said):
        hoist.frequency_response([0.3], [1.0], **options)


def test_nothing_moves(hoist: Drive) -> None:
    with pytest.raises(DomainError, match="nothing moves about 0 V with amplitudes up to 0.08"):
        hoist.frequency_response([0.3, 1.0], [0.05, 0.08])


def test_an_answer_that_does_not_settle(hoist: Drive) -> None:
    slow = hoist.replace(Z6=1e4)  # a lag of twenty minutes
    with pytest.raises(DomainError, match="at 1 Hz and an amplitude of 4 .* settled to 1e-06"):
        slow.frequency_response([1.0], [4.0], bias=2.0, tolerance=1e-6)
