"""Start of a fit: a guess as a parameter set."""

from __future__ import annotations

from dataclasses import replace
from math import asin, isfinite, sqrt, tan

import numpy as np
from numpy.typing import NDArray

from swashplate.drafting.amplifier import AmplifierGuess
from swashplate.drafting.guess import Guess, steady_speed
from swashplate.drive import Drive
from swashplate.errors import ParameterError
from swashplate.parameters import SIDES, ParameterSet

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SHORTEST = 0.005
"""Shortest lag of a guessed drive: a step of the march of a guess, within which none shows. [s]"""
DISTINGUISHED = 0.01
"""Shortest lag that mean speeds distinguish from a delay: a fifth of their window, two steps of the
march. [s]"""
OFFSET = 0.1
"""Largest neutral offset of the spool, over its travel at the greatest speed that was seen. [1]"""
ANGLE = 0.2
"""Angle of the swash plate at the greatest speed that was seen, at most. [rad]"""
STOP_FIRST, ORIFICE_FIRST = 0.9, 0.8
"""Shares of what the largest command asks for at which a stop and an orifice that were not seen are
put first: there they act, so that a fit can tell whether they are there. A stop farther inside
bends the gain, and a search can end with both. [1]"""
STEEPEST = 30.0
"""Volts that a radian takes at least, so that at 10 V and at the upper bounds of all gains the
solenoids do not overpower the feedback spring. [V/rad]"""


def guessed_set(guess: Guess, source: str) -> ParameterSet:
    """The drive "neutral" with the numbers of a guess.

    The source says in the parameter file where they are from.

    Notes
    -----
    The greatest speed that was seen is given a swash angle of 0.2 rad at most, which sets Z10; no
    measurement of a speed could tell it. With sin φ = Z5 Z19 I/√Z4 and tan α = sin φ/Z3 the gain is
    Z10 Z5 Z19 G1/(√Z4 Z3), and the jump likewise one of J; the lag is 1/(Z1 Z3 Z5 Z8 √(Z9/2)); the
    acceleration beyond which the orifice opens no further is Z10 Z1 Z8 √(Z9/2) Z16. The creep
    without a force sets Z18: sin atan(Z18/Z5) = Z3 tan α.

    A limit that the guess did not see may still be there: a lag that is too short can stand for it.
    It is put a little below what the largest command asks for, where a fit can tell, and the set
    says that no test reached it.
    """
    base = Drive.preset("neutral").parameters
    n = base.numbers
    per_angle = max(guess.speed / ANGLE, STEEPEST * max(guess.gain))
    per_ampere = per_angle * n["Z5"] * n["Z19_plus"] / (sqrt(n["Z4"]) * n["Z3"])
    flow = n["Z1"] * sqrt(0.5 * n["Z9"])
    speed_of_flow = 1.0 / (max(guess.lag, SHORTEST) * flow * n["Z3"] * n["Z5"])
    per_opening = per_angle * flow * speed_of_flow
    stops, openings, unreached = list[float](), list[float](), dict[str, float]()
    for column, side in enumerate(SIDES):
        fastest = steady_speed(guess, column)
        top, pull = guess.top_speed[column], guess.acceleration[column]
        if not isfinite(top):
            unreached[f"Z13_{side}"] = fastest / per_angle
            top = STOP_FIRST * fastest
        if not isfinite(pull):
            # how fast it accelerated is not known: a lag that is too short may stand for the limit
            unreached[f"Z16_{side}"] = 0.0
            pull = ORIFICE_FIRST * fastest / max(guess.lag, SHORTEST)
        stops.append(top / per_angle)
        openings.append(pull / per_opening)
    changed: dict[str, float | tuple[float, float]]
    if guess.amplifier is None:
        changed = {
            "V_dz": guess.dead_zone,
            "J": (guess.jump[0] / per_ampere, guess.jump[1] / per_ampere),
            "G1": (guess.gain[0] / per_ampere, guess.gain[1] / per_ampere),
            "tau": guess.delay,
        }
    else:
        changed = _with_current(guess, guess.amplifier, per_ampere / n["Z19_plus"])
    changed |= {
        "Z8": speed_of_flow,
        "Z10": per_angle,
        "Z13": (stops[0], stops[1]),
        "Z16": (openings[0], openings[1]),
    }
    if guess.creep:
        changed["Z18"] = n["Z5"] * tan(asin(n["Z3"] * tan(guess.creep / per_angle)))
    try:
        # what is written here is read again as what somebody wrote
        drive = base.replace(changed)
    except ParameterError as error:
        raise ParameterError(
            f"The guess of {guess.axis} from {source} fails; check units and scales of its "
            f"signals: {error}"
        ) from None
    parameters = {
        symbol: replace(parameter, source=source, status="approximate")
        if symbol in changed
        else replace(parameter, source="assumed: no speed determines it")
        for symbol, parameter in drive.parameters.items()
    }
    if not guess.creep:
        parameters["Z18"] = replace(parameters["Z18"], source=f"assumed: {_without_creep(guess)}")
    title = f"{guess.axis}: guessed from {source}"
    # of a current that was measured the filter has a meaning of its own, whatever the logs' rate
    rate = drive.rate if guess.amplifier is None else None
    card = f"{guess.axis} card"
    return replace(
        drive,
        name=guess.axis,
        title=title,
        card=card,
        parameters=parameters,
        rate=rate,
        unreached=unreached,
        tested=guess.command,
    )


def _with_current(
    guess: Guess, amplifier: AmplifierGuess, per_newton: float
) -> dict[str, float | tuple[float, float]]:
    """Numbers of the amplifier and of the solenoids, by symbol; speed per N of force given.

    The machine moves from the current on that the amplifier has at the edge of the dead zone. A
    jump of the speed is then one of the current beyond the solenoids' dead zone.
    """
    begins, forces = list[float](), list[float]()
    for column in range(2):
        per_ampere = guess.gain[column] / amplifier.gain[column]
        edge = max(guess.dead_zone[column], amplifier.dead_zone[column] + 1e-6)
        begins.append(max(amplifier.settled(column, edge) - guess.jump[column] / per_ampere, 0.0))
        forces.append(per_ampere / per_newton)
    tried = [current for current, command in zip(begins, guess.command, strict=True) if command]
    return {
        "V_dz": amplifier.dead_zone,
        "J": amplifier.jump,
        "G1": amplifier.gain,
        **amplifier.dynamics,
        "tau": amplifier.delay,
        "Z17": sum(tried) / len(tried),
        "Z19": (forces[0], forces[1]),
    }


def _without_creep(guess: Guess) -> str:
    """Reason why no creep is taken in."""
    if guess.creep is None:
        return "the logs rest too seldom to show a creep"
    return "the logs show no creep at rest"
