"""Numbers as a person would have set them: the roundest that the data allow."""

from math import floor, log10


def roundest(value: float, uncertainty: float) -> float:
    """The number of fewest significant digits within `uncertainty` of `value`.

    Of several with as few digits it is the nearest: 0.09997 within 0.0001 is 0.1, 6.4935 within
    0.013 is 6.5.

    Parameters
    ----------
    value : float
        The number as it was fitted.
    uncertainty : float
        How far it may be off, not negative; in the same unit.
    """
    if abs(value) <= uncertainty:
        return 0.0
    exponent = floor(log10(abs(value)))
    for digits in range(-exponent, 17 - exponent):
        candidate = round(value, digits)
        if abs(candidate - value) <= uncertainty:
            return candidate
    return value
