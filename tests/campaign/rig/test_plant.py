import numpy as np
import pytest

from swashplate import Drive, InputError, maneuvers
from swashplate.campaign.rig import Effects, Truth
from swashplate.campaign.rig.plant import simulate_plant

STEP = maneuvers.step(4.0).sample()
LOWER = maneuvers.step(-4.0).sample()
PLATEAU = slice(4 * 512, 6 * 512)


def plant(voltage: np.ndarray = STEP, **effects: object) -> Truth:
    return simulate_plant(Drive.preset("hoist"), voltage, Effects(**effects))


@pytest.mark.parametrize("name", ["hoist", "slew", "luff"])
def test_without_effects_it_is_the_drive_itself(name: str) -> None:
    drive = Drive.preset(name)
    truth, own = simulate_plant(drive, STEP, Effects()), drive.simulate(STEP)
    for ours, its in (
        (truth.time, own.time),
        (truth.voltage, own.voltage),
        (truth.current_plus, own.current_positive),
        (truth.current_minus, own.current_negative),
        (truth.shaft_speed, own.shaft_speed),
        (truth.shaft_position, own.shaft_position),
        (truth.encoder_position, own.shaft_position),
    ):
        np.testing.assert_array_equal(ours, its)


def test_stiction_lets_a_step_of_the_hoist_overshoot_by_four_percent_and_relax() -> None:
    # 97.75 deg/s at 4 V, the static speed of the published parameters
    static = np.radians(97.75)
    voltage = maneuvers.step(4.0, stop=7.0).sample()
    speed = plant(voltage, spool_stiction="on").shaft_speed
    assert speed.max() / static == pytest.approx(1.04, abs=0.005)
    peak = speed.argmax() / 512.0
    assert 1.5 < peak < 2.5
    assert speed[int((peak + 2.0) * 512)] / static == pytest.approx(1.0, abs=0.003)
    strong = plant(voltage, spool_stiction="strong").shaft_speed
    assert strong.max() / static - 1.0 == pytest.approx(0.08, abs=0.01)
    plain = plant(voltage).shaft_speed
    assert plain.max() / static < 1.001


def test_stiction_is_behind_the_ammeter() -> None:
    with_it, without = plant(spool_stiction="on"), plant()
    np.testing.assert_array_equal(with_it.current_plus, without.current_plus)
    assert with_it.simulation.current.max() > 1.05 * without.current_plus.max()


def test_leakage_by_hand() -> None:
    """2 % of Z10 · Z13₋ = 12.396 · 0.26047 rad/s are lost at rated load, half of it at half."""
    full = 12.396 * 0.26047
    for load in (1.0, 0.5):
        raised = plant(STEP, leakage="on", load=load).shaft_speed - plant(STEP).shaft_speed
        lowered = plant(LOWER, leakage="on", load=load).shaft_speed - plant(LOWER).shaft_speed
        np.testing.assert_allclose(raised[PLATEAU], -0.02 * load * full, rtol=1e-9)
        np.testing.assert_allclose(lowered[PLATEAU], -0.02 * load * full, rtol=1e-9)
    assert plant(0.0 * STEP, leakage="strong").shaft_speed[0] == 0.0


def test_cam_ripple_grows_with_the_load_and_turns_with_the_drum() -> None:
    plain = plant().shaft_speed[PLATEAU].mean()
    for load in (0.5, 1.0):
        truth = plant(cam_ripple="on", load=load)
        speed, angle = truth.shaft_speed[PLATEAU], truth.shaft_position[PLATEAU]
        assert speed.max() / plain == pytest.approx(1.0 / (1.0 - 0.04 * load), rel=1e-3)
        assert speed.min() / plain == pytest.approx(1.0 / (1.0 + 0.04 * load), rel=1e-3)
        # from one crossing of the mean to the next of the same direction: 2π/5.5
        above = speed > plain
        ups = np.flatnonzero(~above[:-1] & above[1:])
        np.testing.assert_allclose(np.diff(angle[ups]), 2.0 * np.pi / 5.5, atol=0.01)


def test_backlash_is_between_shaft_and_encoder() -> None:
    voltage = maneuvers.sine(4.0, 0.2, length=12.0).sample()
    truth = plant(voltage, backlash="strong")
    np.testing.assert_array_equal(truth.shaft_speed, plant(voltage).shaft_speed)
    lag = truth.shaft_position - truth.encoder_position
    assert lag.max() == pytest.approx(0.005, rel=1e-9)
    assert lag.min() == pytest.approx(-0.005, rel=1e-9)


@pytest.mark.parametrize("effect", ["leakage", "cam_ripple", "spool_stiction"])
def test_position_is_the_integral_of_the_speed(effect: str) -> None:
    truth = plant(**{effect: "strong"})
    turned = np.cumsum(0.5 * (truth.shaft_speed[1:] + truth.shaft_speed[:-1])) / 512.0
    # the ripple's angle is exact, its trapezoids are not
    np.testing.assert_allclose(truth.shaft_position[1:], turned, atol=1e-5)


@pytest.mark.parametrize("name", ["hoist", "slew", "luff"])
def test_all_effects_at_their_strongest_are_simulated(name: str) -> None:
    strongest = Effects("strong", "strong", "strong", "strong", load=1.0)
    for run in maneuvers.source_tests(name).values():
        truth = simulate_plant(Drive.preset(name), run.sample(), strongest)
        assert np.isfinite(truth.encoder_position).all()
    assert strongest.active == (
        "cam_ripple strong",
        "spool_stiction strong",
        "backlash strong",
        "leakage strong",
    )
    assert Effects().active == ()


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"leakage": "some"}, "leakage is 'off', 'on' or 'strong', not 'some'."),
        ({"load": 1.5}, "load is a share of the rated load, 0 to 1, not 1.5."),
    ],
)
def test_unknown_effects_are_refused(wrong: dict, sentence: str) -> None:
    with pytest.raises(InputError) as error:
        Effects(**wrong)
    assert str(error.value) == sentence
