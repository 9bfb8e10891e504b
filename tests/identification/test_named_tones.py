"""Tones as they are told: a line a channel, whatever number of them there is."""

import numpy as np

from swashplate.identification.spectral_lines import Tone, distinct, tone_sentences


def tone(channel: str, low: float, high: float, share: float) -> Tone:
    return Tone(channel, low, high, share, np.array([low, high]), np.ones(2))


RIPPLE = tone("current", 95.0, 101.0, 0.9)
ROUNDING = (
    tone("counts", 21.0, 22.0, 0.089),
    tone("counts", 3.5, 4.0, 0.014),
    # the same line in a later round, on the flank of the first
    tone("counts", 3.75, 4.25, 0.0087),
    tone("counts", 255.0, 255.0, 0.0039),
)


def test_a_single_tone_has_its_own_line() -> None:
    assert tone_sentences([RIPPLE]) == (
        "A tone at 98 Hz makes 90 % of the residuals' variance of current; no unknown depends on "
        "it, and the noise is judged without it.",
    )


def test_many_tones_are_one_line_a_channel() -> None:
    # 8.9 + 1.4 + 0.87 + 0.39 % are 11.56 %
    assert tone_sentences([ROUNDING[0], RIPPLE, *ROUNDING[1:]]) == (
        "3 tones between 3.75 and 255 Hz make 12 % of the residuals' variance of counts, the "
        "largest 8.9 % at 21.5 Hz; no unknown depends on them, and the noise is judged without "
        "them.",
        *tone_sentences([RIPPLE]),
    )
    assert tone_sentences([]) == ()


def test_a_line_that_was_found_twice_is_one() -> None:
    found = distinct(ROUNDING)
    assert [each.frequency for each in found] == [3.75, 21.5, 255.0]
    assert found[0].share == 0.014 + 0.0087
    # what overlaps by its frequency alone, in another channel, is another
    assert len(distinct([RIPPLE, RIPPLE._replace(channel="torque")])) == 2
