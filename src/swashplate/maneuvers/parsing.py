"""Manoeuvres from the text of a command line."""

import inspect
from collections.abc import Callable

from swashplate.errors import InputError
from swashplate.maneuvers.pieces import Maneuver
from swashplate.maneuvers.shapes import ramp, rest, stairs, step
from swashplate.maneuvers.sines import chirp, multisine, sine

_COMMANDS: dict[str, Callable[..., Maneuver]] = {
    make.__name__: make for make in (rest, step, ramp, sine, stairs, chirp, multisine)
}


def parse(text: str) -> Maneuver:
    """Make a manoeuvre from a command line's "sine:6.5,0.1,length=40" or "stairs:2/4/0,dwell=3".

    Parameters
    ----------
    text : str
        Name of a function that makes a manoeuvre, colon, its arguments by position or keyword, in
        V, s and Hz. A list is written 2/4/0, the band of a multisine low:high:count.

    Raises
    ------
    InputError
        If name, arguments or a number are wrong; it lists what is right.
    """
    name, _, arguments = text.partition(":")
    if name not in _COMMANDS:
        raise InputError(f"{name!r} is no manoeuvre: choose one of {', '.join(_COMMANDS)}.")
    items = [item.rpartition("=") for item in arguments.split(",")] if arguments else []
    positional = [_value(value) for _, equals, value in items if not equals]
    keywords = {key.strip(): _value(value) for key, equals, value in items if equals}
    if len(positional) + len(keywords) < len(items):
        raise InputError(f"{text!r} gives a keyword twice: give it once.")
    signature = inspect.signature(_COMMANDS[name])
    try:
        signature.bind(*positional, **keywords)
    except TypeError as error:
        known = ", ".join(signature.parameters)
        raise InputError(f"{text!r}: {error}; {name} takes {known}.") from None
    return _COMMANDS[name](*positional, **keywords)


def _value(text: str) -> int | float | list[int | float] | tuple[int | float, ...]:
    if "/" in text:
        return [_number(part) for part in text.split("/")]
    if ":" in text:
        return tuple(_number(part) for part in text.split(":"))
    return _number(text)


def _number(text: str) -> int | float:
    try:
        return int(text) if text.strip().isdecimal() else float(text)
    except ValueError:
        raise InputError(
            f"{text!r} is not a number: write one as 6.5, a list as 2/4/0, a band as 0.1:2:8."
        ) from None
