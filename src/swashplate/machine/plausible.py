"""Numbers that somebody wrote: each within the range in which it can be meant.

The range stands with the parameter, as `swashplate.machine.fields.Definition.plausible`. What a
search, a draw or another number leads to is not judged by it.
"""

from math import inf

from swashplate.errors import ParameterError
from swashplate.machine.fields import Definition
from swashplate.units import scaling

WRITTEN_IN: dict[str, tuple[str, ...]] = {
    "1/Pa": ("1/bar", "1/MPa"),
    "1/s": ("1/min",),
    "A": ("mA",),
    "A/V": ("mA/V",),
    "A/V^2": ("mA/V^2",),
    "A/V^3": ("mA/V^3",),
    "A/s": ("mA/s",),
    "N m": ("N mm",),
    "N/m": ("N/mm",),
    "N^2 m^2": ("N^2 mm^2",),
    "Pa": ("bar", "MPa", "GPa", "psi"),
    "V": ("mV",),
    "kg": ("g",),
    "kg m^2": ("kg cm^2", "kg mm^2"),
    "m": ("mm", "um"),
    "m^2": ("cm^2", "mm^2"),
    "m^3": ("cm^3", "mm^3"),
    "m^3/s": ("l/min",),
    "rad": ("deg",),
    "rad/s": ("deg/s", "rpm"),
    "s": ("ms", "us"),
    "sqrt(Pa)/(m s)": ("bar^0.5/(m s)", "Pa^0.5/(mm s)"),
}
"""Units that people write in place of an SI unit, the likeliest first."""
LARGEST_SHARE = 10.0
"""Of what has no unit and may be no larger, people write per cent."""


def check_plausible(column: str, definition: Definition, *values: float) -> None:
    """Refuse a number that can hardly be meant.

    Parameters
    ----------
    column : str
        What the numbers are of, as the sentence names it: ``"Z16_plus"``.
    definition : Definition
        Its definition; without a plausible range nothing is refused. 0 and infinity never are: they
        stand for "none", which is a matter of the parameter's rules, as are NaN and a wrong sign.
    *values : float
        In SI.

    Raises
    ------
    ParameterError
        For the first one beyond the range; the sentence names value, unit and range, and the unit
        that it is likely in.
    """
    if definition.plausible is None:
        return
    low, high = definition.plausible
    for value in values:
        size = abs(value)
        of_wrong_sign = value < 0.0 <= definition.lower
        if of_wrong_sign or size in (0.0, inf) or not (size < low or size > high):
            continue
        unit = "" if definition.unit == "1" else f" {definition.unit}"
        either_way = " either way" if definition.lower < 0.0 else ""
        raise ParameterError(
            f"{column} ({definition.name}) is {value:g}{unit}, but on a machine it is "
            f"{definition.plausible_range}{unit}{either_way}: {_slip(definition, value)}."
        )


def _slip(definition: Definition, value: float) -> str:
    """The likely slip: a unit in which the number would be plausible, if there is one."""
    assert definition.plausible is not None
    low, high = definition.plausible
    for unit in WRITTEN_IN.get(definition.unit, ()):
        factor, _ = scaling(unit, definition.unit, definition.name)
        if low <= factor * abs(value) <= high:
            return f"perhaps it is in {unit} instead of {definition.unit}"
    if definition.unit == "1" and high <= LARGEST_SHARE and low <= abs(value) / 100.0 <= high:
        return "perhaps it is in per cent"
    return "check the number and its unit"
