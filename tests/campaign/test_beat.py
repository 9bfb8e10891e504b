"""Where a dither shows in samples, and that its removal says what it did."""

import numpy as np
import pytest

from swashplate import Drive
from swashplate.campaign.beat import alias_frequencies, remove_beat
from swashplate.errors import InputError

TIME = np.arange(10 * 512) / 512.0


def test_aliases_of_100_hz_at_512_hz() -> None:
    found = alias_frequencies(100.0, 512.0)
    # 300 is 212 below 512, 400 is 112 below, 500 is 12 below
    assert [each.alias for each in found] == [100.0, 200.0, 212.0, 112.0, 12.0]
    assert [each.frequency for each in found] == [100.0, 200.0, 300.0, 400.0, 500.0]
    # 600 is 88 above 512, 1000 is 24 below 1024
    assert [each.alias for each in alias_frequencies(100.0, 512.0, harmonics=(6, 10))] == [88, 24]


@pytest.mark.parametrize("harmonic", [1, 3, 5, 6, 11])
def test_samples_cannot_tell_a_tone_from_its_alias(harmonic: int) -> None:
    (alias,) = alias_frequencies(100.0, 512.0, harmonics=(harmonic,))
    tone = np.cos(2.0 * np.pi * alias.frequency * TIME)
    np.testing.assert_allclose(tone, np.cos(2.0 * np.pi * alias.alias * TIME), atol=1e-8)


def test_a_tone_is_removed_and_accounted_for() -> None:
    slow = 0.4 + 0.2 * np.sin(2.0 * np.pi * 0.5 * TIME)
    tones = 0.03 * np.sin(2.0 * np.pi * 100.0 * TIME) + 0.02 * np.cos(2.0 * np.pi * 500.0 * TIME)
    found = remove_beat(TIME, slow + tones, pwm_frequency=100.0, harmonics=(1, 5), signal_band=20.0)
    assert [each.alias for each in found.tones] == [12.0, 100.0]
    assert [each.harmonics for each in found.tones] == [(5,), (1,)]
    inner = slice(512, -512)  # away from the ends, where a notch rings
    np.testing.assert_allclose(found.values[inner], slow[inner], atol=1e-3)
    rms = [each.rms for each in found.tones]
    np.testing.assert_allclose(rms, [0.02 / np.sqrt(2.0), 0.03 / np.sqrt(2.0)], rtol=0.03)
    assert found.rms == pytest.approx(np.hypot(*rms), rel=0.01)
    assert found.touched == pytest.approx(2.0 / 20.0)  # 11 to 13 Hz of 0 to 20 Hz


def test_multiples_that_share_an_alias_are_notched_once() -> None:
    # 100 and 412 Hz at 512 Hz: 412 is 4.12 times 100, so take 128 Hz: 128, 256·…, 384 → 128
    found = remove_beat(TIME, np.sin(TIME), pwm_frequency=128.0, harmonics=(1, 3), signal_band=10.0)
    assert [each.harmonics for each in found.tones] == [(1, 3)]
    assert found.touched == 0.0


@pytest.mark.parametrize("grows", [False, True])
@pytest.mark.parametrize("modulation", [100.0, 100.07])
def test_step_of_a_card_keeps_its_shape(grows: bool, modulation: float) -> None:
    time = np.arange(10 * 512 + 1) / 512.0
    steps = Drive.preset("hoist").simulate(9.0 * ((time >= 1.0) & (time < 6.0)))
    true = np.asarray(steps.current_positive)
    amplitude = 0.04 * true if grows else 0.02
    beat = sum(amplitude / k * np.cos(2.0 * np.pi * k * modulation * time + k) for k in (1, 2, 5))
    found = remove_beat(
        time, true + beat, pwm_frequency=100.0, harmonics=(1, 2, 5), signal_band=20.0
    )
    left = np.sqrt(np.mean((found.values - true) ** 2))
    # 16 and 17 mA before; the module says 2 to 3.5 mA
    assert np.sqrt(np.mean(beat**2)) > 15e-3
    assert left < 3.5e-3
    # zero phase: half the step is passed at the same sample
    assert abs(np.argmax(found.values > 0.3) - np.argmax(true > 0.3)) <= 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"harmonics": (128,)}, "Harmonic 128 of 100 Hz shows at 0 Hz, too near .* leave it out"),
        ({"harmonics": (0,)}, "from 1 up, not 0"),
        ({"harmonics": (1.5,)}, "whole number"),
        ({"width": 0.05}, "0.05 Hz wide needs more than 20 s, not 10 s"),
        ({"signal_band": 0.0}, "signal_band must be positive"),
    ],
)
def test_impossible_removals_are_refused(options: dict, said: str) -> None:
    arguments = {"pwm_frequency": 100.0, "harmonics": (1,), "signal_band": 20.0, **options}
    with pytest.raises(InputError, match=said):
        remove_beat(TIME, np.sin(TIME), **arguments)


def test_uneven_stamps_are_refused() -> None:
    with pytest.raises(InputError, match="removal of a beat needs evenly spaced stamps"):
        remove_beat(TIME**1.1, TIME, pwm_frequency=100.0, harmonics=(1,), signal_band=20.0)
