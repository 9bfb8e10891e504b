"""The dither of a control card in samples taken too slowly for it: where it beats, and its removal.

A card's pulse width modulation puts its frequency and the multiples of it into the current. What
lies above half the sample rate shows at an alias, which may be as slow as the current itself.

Two ways of removal were measured on simulated currents of the hoist (steps of 4 and 9 V, a sine of
6.5 V at 0.3 Hz) with a dither of 11 to 17 mA RMS at its multiples 1, 2 and 5, the last at 12 Hz.
Sinusoids of fixed amplitude, fitted by least squares together with their frequency, left 0.4 to
1.9 mA where the dither's amplitude was constant, but 6 to 12 mA where it grew with the current.
Notches 2 Hz wide, run forth and back, left 2 to 3.5 mA either way, and most of that is what the
notch at 12 Hz takes from the current. They are what `remove_beat` uses.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from swashplate.campaign.stamps import Array, even_period, signal
from swashplate.errors import InputError
from swashplate.maneuvers.checks import positive, whole


class Alias(NamedTuple):
    """Where one multiple of the modulation shows."""

    harmonic: int
    frequency: float
    """Its true frequency. [Hz]"""
    alias: float
    """The frequency it shows at, 0 to half the sample rate. [Hz]"""


class Tone(NamedTuple):
    """What was removed around one frequency."""

    alias: float
    """[Hz]"""
    harmonics: tuple[int, ...]
    """Multiples of the modulation that show there."""
    rms: float
    """RMS of what was taken out, in the signal's unit."""


class BeatRemoval(NamedTuple):
    """A signal without its beat, and what that cost."""

    values: Array
    """(n,) the signal, of the same phase."""
    tones: tuple[Tone, ...]
    """What was removed, lowest frequency first."""
    rms: float
    """RMS of all that was removed, in the signal's unit."""
    touched: float
    """Share of the true signal's band that lies within a notch, 0 to 1."""


def alias_frequencies(
    pwm_frequency: float, sample_rate: float, *, harmonics: Sequence[int] = (1, 2, 3, 4, 5)
) -> tuple[Alias, ...]:
    """Where the multiples of a modulation show in samples.

    Parameters
    ----------
    pwm_frequency, sample_rate : float
        Both positive. [Hz]
    harmonics : sequence of int
        Multiples, from 1 up.

    Returns
    -------
    tuple of Alias
        In the order of `harmonics`. Of 100 Hz at 512 Hz: 100, 200, 212, 112, 12 Hz.

    Raises
    ------
    InputError
        If a frequency is not positive or a multiple is no whole number from 1 up.
    """
    modulation = positive("pwm_frequency", pwm_frequency)
    rate = positive("sample_rate", sample_rate)
    found = []
    for each in harmonics:
        if (harmonic := whole("harmonics", each)) < 1:
            raise InputError("harmonics must be whole numbers from 1 up, not 0.")
        rest = (harmonic * modulation) % rate
        found.append(Alias(harmonic, harmonic * modulation, min(rest, rate - rest)))
    return tuple(found)


def remove_beat(
    time: ArrayLike,
    values: ArrayLike,
    *,
    pwm_frequency: float,
    harmonics: Sequence[int],
    signal_band: float,
    width: float = 2.0,
) -> BeatRemoval:
    """Notch a modulation and its multiples out of a signal, without phase.

    Parameters
    ----------
    time : array_like, shape (n,)
        Evenly spaced stamps. [s]
    values : array_like, shape (n,)
        The signal, e.g. a current.
    pwm_frequency : float
        Modulation. [Hz]
    harmonics : sequence of int
        Multiples to remove. Leave out those whose alias the signal itself needs.
    signal_band : float
        Highest frequency that the true signal is thought to have; only for `touched`. [Hz]
    width : float
        Width of a notch, at half the power of one pass. It must hold the modulation's drift; a
        wider one takes more of the signal. [Hz]

    Returns
    -------
    BeatRemoval
        At either end, and beside a step, a notch rings for about 1/width.

    Raises
    ------
    InputError
        If the stamps are uneven, the record is shorter than 1/width, a number is not finite, or an
        alias is so near to 0 or half the sample rate that no notch fits.
    """
    from scipy.signal import filtfilt, iirnotch

    rate = 1.0 / even_period(time, "The removal of a beat")
    kept = signal("values", values, np.size(time))
    band, notch = positive("signal_band", signal_band), positive("width", width)
    if kept.size <= rate / notch:
        raise InputError(
            f"A notch {notch:g} Hz wide needs more than {1.0 / notch:g} s, not "
            f"{kept.size / rate:.3g} s; take a wider one."
        )
    shared: dict[float, list[int]] = {}
    for each in alias_frequencies(pwm_frequency, rate, harmonics=harmonics):
        if not notch <= each.alias <= 0.5 * rate - notch:
            raise InputError(
                f"Harmonic {each.harmonic} of {pwm_frequency:g} Hz shows at {each.alias:.4g} Hz, "
                f"too near to 0 or {0.5 * rate:.4g} Hz for a notch {notch:g} Hz wide; leave it out."
            )
        near = [alias for alias in shared if abs(alias - each.alias) < 0.01 * notch]
        shared.setdefault(near[0] if near else each.alias, []).append(each.harmonic)
    given, tones = kept, []
    padding = min(kept.size - 1, int(3.0 * rate / notch))
    for alias in sorted(shared):
        b, a = iirnotch(alias, alias / notch, rate)
        without = filtfilt(b, a, kept, padlen=padding)
        tones.append(Tone(alias, tuple(shared[alias]), _rms(kept - without)))
        kept = without
    return BeatRemoval(kept, tuple(tones), _rms(given - kept), _touched(shared, band, notch))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _touched(aliases: Iterable[float], band: float, width: float) -> float:
    """Share of the band from 0 up that the notches cover, overlaps counted once."""
    covered, reached = 0.0, 0.0
    for alias in sorted(aliases):
        low, high = max(alias - 0.5 * width, reached), min(alias + 0.5 * width, band)
        if high > low:
            covered += high - low
            reached = high
    return covered / band
