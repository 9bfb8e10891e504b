"""Bandwidth and margins, and sweeps, against closed forms, eigenvalues and simulations."""

from dataclasses import replace
from math import atan, ceil, inf, pi

import numpy as np
import polars as pl
import pytest

from swashplate import DomainError, Drive, InputError
from swashplate.drive import LinearDrive, response_table
from swashplate.machine.linear import loop_margins


def radius(model: LinearDrive, gain: float, late: int = 0) -> float:
    """Largest |eigenvalue| of a sampled loop u = -K y, which the controller closes `late` samples
    after the drive's own delay."""
    assert model.rate is not None
    whole = round(model.delay * model.rate) + late
    n = model.A.shape[0]
    loop = np.zeros((n + whole, n + whole))
    loop[:n, :n] = model.A
    loop[:n, -1:] = model.B
    loop[n, :n] = -gain * model.C[0]
    loop[n + 1 :, n:-1] = np.eye(whole - 1)
    return float(np.abs(np.linalg.eigvals(loop)).max())


@pytest.mark.parametrize("rate", [512.0, 2000.0])
def test_the_largest_gain_brings_the_loop_to_its_edge(axis: Drive, rate: float) -> None:
    model = axis.linearize(2.0).discrete(rate)
    largest = model.largest_gain
    assert radius(model, largest) == pytest.approx(1.0, abs=1e-9)
    assert radius(model, 0.99 * largest) < 1.0 < radius(model, 1.01 * largest)
    assert model.margins(0.5 * largest).gain_margin == pytest.approx(2.0)


def test_the_delay_margin_brings_the_loop_to_its_edge(hoist: Drive) -> None:
    rate = 2048.0
    model = hoist.linearize(4.0).discrete(rate)
    gain = 0.5 * model.largest_gain
    whole = int(model.margins(gain).delay_margin * rate)
    assert whole > 50
    assert radius(model, gain, whole) < 1.0 < radius(model, gain, whole + 1)


def test_a_first_order_lag(hoist: Drive) -> None:
    # G = g/(1 + s τ): |K G| = 1 at ω τ = √((K g)² - 1), phase margin π - atan(ω τ)
    model = hoist.linearize(current=0.45)
    tau, factor = model.time_constant, 3.0
    assert model.bandwidth == pytest.approx(1.0 / (2.0 * pi * tau), rel=1e-9)
    assert model.largest_gain == inf
    margins = model.margins(factor / model.gain)
    wt = np.sqrt(factor**2 - 1.0)
    assert margins.crossover == pytest.approx(wt / tau / (2.0 * pi))
    assert margins.phase_margin == pytest.approx(pi - atan(wt))
    assert margins.delay_margin == pytest.approx((pi - atan(wt)) * tau / wt)
    assert margins.gain_margin == inf
    # below 1 everywhere: no crossover, no limit
    assert model.margins(0.5 / model.gain) == (0.0, inf, inf, inf)


def test_a_gain_of_the_wrong_sign_has_its_margin_at_rest(hoist: Drive) -> None:
    # -g/(1 + s τ) begins on the negative axis: 1 + K G is 0 at K g = 1
    model = hoist.linearize(current=0.45)
    assert model.margins(-0.5 / model.gain).gain_margin == pytest.approx(2.0)


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.4])
def test_an_integrator_with_delay(delay: float) -> None:
    # L = K/(jω) e^(-jω delay): crossover ω = K, phase margin π/2 - K delay; edge at K delay = π/2
    gain = 3.0

    def loop(f: np.ndarray) -> np.ndarray:
        s = 2j * pi * f
        return gain / s * np.exp(-s * delay)

    crossover, phase, late, factor = loop_margins(loop, delay, 1e4, "a tank")
    assert crossover == pytest.approx(gain / (2.0 * pi))
    assert phase == pytest.approx(0.5 * pi - gain * delay)
    assert late == pytest.approx(0.5 * pi / gain - delay)
    assert factor == pytest.approx(0.5 * pi / (gain * delay) if delay else inf)


def test_unstable_loops_have_no_margins(hoist: Drive) -> None:
    model = hoist.linearize(4.0)
    for gain in (1.001 * model.largest_gain, 1e3 * model.largest_gain, -1.5 / model.gain):
        with pytest.raises(DomainError, match="hoist: .*closed loop"):
            model.margins(gain)
    with pytest.raises(DomainError, match="hoist: .*closed loop"):
        model.margins(lambda f: -0.1 / (2j * pi * f))
    with pytest.raises(DomainError, match="hoist: .*closed loop"):
        model.discrete(512.0).margins(1.01 * model.discrete(512.0).largest_gain)


def test_loops_without_sense(hoist: Drive) -> None:
    model = hoist.linearize(4.0)
    with pytest.raises(InputError, match="hoist: .*controller"):
        model.margins(float("nan"))
    closed = hoist.linearize(4.0, outputs=["spool_position"])
    for value in ("bandwidth", "largest_gain"):
        with pytest.raises(DomainError, match="gain is 0"):
            getattr(closed, value)
    unstable = replace(hoist.linearize(current=0.45), A=np.array([[1.0]]))
    with pytest.raises(DomainError, match="unstable .poles"):
        print(unstable.bandwidth)


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
        rate = frequency * ceil(512.0 / frequency)
        exact = model.discrete(rate).response(frequency)[0]
        assert abs(ratio / exact - 1.0) < 1e-6
        # promised is 0.1 %; the continuous model is apart by the time of about one step
        continuous = model.response(frequency)[0]
        assert abs(ratio / continuous - 1.0) < 1.1 * 2.0 * np.pi * frequency / rate
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
        "stroker_pressure",
        "orifice_opening",
        "solenoid_force",
        "current",
    ],
)
def test_every_output(hoist: Drive, output: str) -> None:
    swept = hoist.frequency_response([1.0], [1e-4], bias=4.0, output=output)
    model = hoist.linearize(4.0, outputs=[output]).discrete(512.0)
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
    assert swept.has_motion[:, 0].tolist() == [False, True, True, True]
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
    assert table["phase"].null_count() == int((~swept.has_motion).sum()) > 0
    assert table["amplitude"].to_list() == [0.25] * 3 + [4.0] * 3
    assert table["gain"].to_list()[4] == swept.gain[1, 1]
    swept.write(tmp_path / "bode.csv")
    assert pl.read_csv(tmp_path / "bode.csv").columns == table.columns
    with pytest.raises(InputError, match="0.15 Hz; .* 0.1 Hz"):
        response_table(swept, 0.15)


def test_phases_are_followed(axis: Drive) -> None:
    f = np.geomspace(0.02, 8.0, 40)
    phase = axis.frequency_response(f, [0.5, 6.5], bias=0.0).phase
    for row in phase:
        there = row[np.isfinite(row)]
        assert np.abs(np.diff(there)).max() < np.pi
        assert (there < 0.05).all()


@pytest.mark.parametrize(
    ("arguments", "options", "said"),
    [
        (([], [1.0]), {}, "frequencies .* above 0"),
        (([0.3, 0.2], [1.0]), {}, "rise from 0.001 Hz"),
        (([0.3, 100.0], [1.0]), {}, "64 Hz"),
        (([0.3], [11.0]), {}, "11 V, .* ±10 V"),
        (([0.3], [1.0]), {"bias": 9.5}, "10.5 V, .* ±10 V"),
        (
            ([0.3], [1.0]),
            {"output": "torque"},
            "'torque' .* output of a sweep",
        ),
        (([0.3], [1.0]), {"rate": 100.0}, "512 and 100000 Hz"),
        (([0.3, 1.0], [0.05, 0.08]), {}, "0 V .* 0.08"),
    ],
)
def test_sweeps_without_sense_are_refused(
    hoist: Drive, arguments: tuple, options: dict, said: str
) -> None:
    with pytest.raises((InputError, DomainError), match=said):
        hoist.frequency_response(*arguments, **options)


def test_an_answer_that_does_not_settle(hoist: Drive) -> None:
    slow = hoist.replace(Z6=1e4)  # a lag of twenty minutes
    with pytest.raises(DomainError, match="1 Hz .* 4 .* 1e-06"):
        slow.frequency_response([1.0], [4.0], bias=2.0, tolerance=1e-6)
