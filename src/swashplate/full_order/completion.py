"""From lumped parameters and a few chosen values to a whole physical set."""

from __future__ import annotations

from collections.abc import Mapping
from math import sqrt

from swashplate.errors import ParameterError
from swashplate.full_order.lumps import AGREES, static_pressure
from swashplate.full_order.physical_set import PhysicalSet, PhysicalValue, quantity_of, value_of
from swashplate.full_order.quantities import CHOICES, QUANTITIES
from swashplate.parameters.parameter_set import Change, Pair, ParameterSet, Value

ASSUMED: Mapping[str, float] = {
    "feedback_spring_arm": 0.03,
    "spool_mass": 0.01,
    "spool_frequency": 251.32741228718345,  # 40 Hz, which the source states for both modes
    "spool_damping_ratio": 0.3,
    "oil_volume": 2e-4,
    "bulk_modulus": 1e9,
    "piston_area": 2.8274333882308137e-3,  # 60 mm across
    "swash_arm": 0.08,
    "piston_mass": 0.4,
    "swash_frequency": 251.32741228718345,
    "swash_damping_ratio": 0.3,
    "pumping_area": 5e-4,
    "pumping_arm": 0.002,
    "motor_constant": 250.3261078557604,  # 25.1 l a turn
    "load_inertia": 0.0,
    "load_torque": 0.0,
}
"""What `from_lumped` chooses where nothing else is given."""

IN_PLACE_OF: Mapping[str, str] = {
    "feedback_arm_inertia": "spool_frequency",
    "spool_damping": "spool_damping_ratio",
    "swash_inertia": "swash_frequency",
    "piston_damping": "swash_damping_ratio",
}
"""Quantities that may be chosen in place of a frequency or a damping ratio."""


def chosen_over(
    assumed: Mapping[str, PhysicalValue], chosen: Mapping[str, Change]
) -> dict[str, PhysicalValue]:
    """What a set is completed from: assumed values, and the user's in their place.

    Parameters
    ----------
    assumed : mapping
        Values by the names that `from_lumped` takes.
    chosen : mapping of str to float or (float, float)
        The user's values in SI, by the same names. An inertia or damping also takes the place of
        the frequency or damping ratio that it would otherwise follow from.

    Raises
    ------
    ParameterError
        For an unknown name or a value of another form.
    """
    entries = dict(assumed)
    for name, change in chosen.items():
        quantity = CHOICES[name] if name in CHOICES else quantity_of(name)
        entries[name] = PhysicalValue(quantity, value_of(quantity, change))
        instead = IN_PLACE_OF.get(name)
        if instead is not None and instead not in chosen:
            entries.pop(instead, None)
    return entries


def from_lumped(
    parameters: ParameterSet,
    *,
    name: str | None = None,
    title: str = "",
    entries: Mapping[str, PhysicalValue] | None = None,
    **chosen: Change,
) -> PhysicalSet:
    """Complete a physical set from lumped parameters and a few chosen values.

    Parameters
    ----------
    parameters : ParameterSet
        The lumped parameters that the set shall have, Z6 apart.
    name, title : str, optional
        Of the set; by default the parameters' name.
    entries : mapping, optional
        Chosen values with source and status.
    **chosen : float or (float, float)
        Chosen values in SI by name. Names are those of `ASSUMED`, whose values count where nothing
        is given, or any other quantity: an inertia or damping in place of a frequency or damping
        ratio, or one that follows from the lumps, which must then agree with them.

    Returns
    -------
    PhysicalSet
        Everything but what the user chose is marked as assumed.

    Raises
    ------
    ParameterError
        If lumps contradict each other or a chosen value; the sentence names them.
    """
    owner = parameters.name if name is None else name
    given = chosen_over(entries or {}, chosen)
    for made_from, choice in IN_PLACE_OF.items():
        if made_from in given and choice in given:
            raise ParameterError(
                f"{owner}: {made_from} and {choice} are both given, but either follows from the "
                "other; leave one out."
            )
    numbers = {**ASSUMED}
    for entry in given.values():
        for column, value in zip(entry.quantity.columns, entry.values, strict=True):
            entry.quantity.check(owner, column, value)
            numbers[column] = value
    following = _completed(owner, parameters.numbers, numbers, set(given))
    complete = {}
    for quantity in QUANTITIES.values():
        columns = quantity.columns
        if all(column in following for column in columns):
            made, why = [following[column] for column in columns], following_from(quantity.name)
        else:
            made, why = [numbers[column] for column in columns], "assumed"
        if quantity.name in given:
            _check_agreement(owner, given[quantity.name], made, why)
            complete[quantity.name] = given[quantity.name]
        else:
            follows: Value = Pair(*made) if quantity.directional else made[0]
            complete[quantity.name] = PhysicalValue(quantity, follows, why, "assumed")
    return PhysicalSet(owner, title, complete)


_ORIGINS = {
    "spool_arm": "Z5",
    "feedback_spring_rate": "√Z4 and feedback_spring_arm",
    "control_arm": "Z3 and swash_arm",
    "plussing": "Z18",
    "spool_stroke": "Z14",
    "orifice_opening": "Z16",
    "valve_flow_gain": "Z8/(1+Z6), oil_volume and bulk_modulus",
    "piston_leakage": "Z7/(1+Z6), oil_volume and bulk_modulus",
    "supply_pressure": "Z9 and load_torque",
    "relief_pressure": "Z15",
    "return_spring_rate": "Z1, piston_area and swash_arm",
    "swash_stop": "Z13",
    "pump_flow_gain": "Z10 and motor_constant",
    "motor_leakage": "Z11 and Z12, load_torque and load_inertia",
    "feedback_arm_inertia": "Z4, Z5, spool_frequency and spool_mass",
    "spool_damping": "spool_damping_ratio",
    "swash_inertia": "Z1, swash_frequency, piston_area, swash_arm and piston_mass",
    "piston_damping": "swash_damping_ratio",
}


def following_from(name: str) -> str:
    """What a quantity follows from when a set is completed."""
    return f"from {_ORIGINS[name]}"


def _completed(
    owner: str, Z: Mapping[str, float], chosen: dict[str, float], given: set[str]
) -> dict[str, float]:
    """Quantities that follow from the lumps and what is chosen."""
    if Z["Z2"] != 0.0:
        raise ParameterError(
            f"{owner}: Z2 is {Z['Z2']:g}, but a physical set has Z2 = 0, because the pressure is "
            "counted from the one that holds the load (eq. 6.56)."
        )
    arm, area = chosen["swash_arm"], chosen["piston_area"]
    stiffness = chosen["bulk_modulus"] / chosen["oil_volume"]
    spring_rate = area / (Z["Z1"] * arm)
    gauge = (1.0 + area**2 * stiffness / spring_rate) / (1.0 + Z["Z6"]) / stiffness
    made = {
        "spool_arm": Z["Z5"],
        "feedback_spring_rate": Z["Z4"] ** 0.5 / chosen["feedback_spring_arm"] ** 2,
        "control_arm": arm / Z["Z3"],
        "plussing": Z["Z18"],
        "spool_stroke": Z["Z14"],
        "orifice_opening_plus": Z["Z16_plus"],
        "orifice_opening_minus": Z["Z16_minus"],
        "valve_flow_gain": Z["Z8"] * gauge,
        "piston_leakage": Z["Z7"] * gauge,
        "supply_pressure": Z["Z9"] + static_pressure(chosen),
        "relief_pressure": Z["Z15"],
        "return_spring_rate": spring_rate,
        "swash_stop_plus": Z["Z13_plus"],
        "swash_stop_minus": Z["Z13_minus"],
        "pump_flow_gain": Z["Z10"] / chosen["motor_constant"],
        "motor_leakage": _motor_leakage(owner, Z, chosen),
    }
    spring_moment, lever = Z["Z4"] ** 0.5, chosen["spool_mass"] * Z["Z5"] ** 2
    if "feedback_arm_inertia" not in given:
        chosen["feedback_arm_inertia"] = made["feedback_arm_inertia"] = _remaining_inertia(
            owner,
            spring_moment / chosen["spool_frequency"] ** 2,
            lever,
            "spool_mass on spool_arm",
            "spool_frequency",
        )
    if "spool_damping" not in given:
        swinging = sqrt(spring_moment * (chosen["feedback_arm_inertia"] + lever))
        made["spool_damping"] = 2.0 * chosen["spool_damping_ratio"] * swinging / Z["Z5"] ** 2
    plate_spring, lever = spring_rate * arm**2, chosen["piston_mass"] * arm**2
    if "swash_inertia" not in given:
        chosen["swash_inertia"] = made["swash_inertia"] = _remaining_inertia(
            owner,
            plate_spring / chosen["swash_frequency"] ** 2,
            lever,
            "piston_mass on swash_arm",
            "swash_frequency",
        )
    if "piston_damping" not in given:
        swinging = sqrt(plate_spring * (chosen["swash_inertia"] + lever))
        made["piston_damping"] = 2.0 * chosen["swash_damping_ratio"] * swinging / arm**2
    return made


def _remaining_inertia(owner: str, total: float, part: float, what: str, frequency: str) -> float:
    if part > total:
        raise ParameterError(
            f"{owner}: {what} alone has {part:.4g} kg m², but {frequency} leaves {total:.4g} kg m² "
            "for everything that swings with it; choose a smaller mass or a lower frequency."
        )
    return total - part


def _motor_leakage(owner: str, Z: Mapping[str, float], chosen: Mapping[str, float]) -> float:
    """K_mL from Z11 = K_mL C_g and Z12 = K_mL Z10 C_i, which must agree."""
    losses = {
        "Z11": (Z["Z11"], chosen["load_torque"], "load_torque"),
        "Z12": (Z["Z12"], Z["Z10"] * chosen["load_inertia"], "load_inertia"),
    }
    leakages = []
    for symbol, (loss, load, cause) in losses.items():
        if load != 0.0:
            leakages.append(loss / load)
        elif loss != 0.0:
            raise ParameterError(
                f"{owner}: {symbol} is {loss:g}, but without {cause} no speed is lost to it; "
                f"choose {cause}, or set {symbol} to 0."
            )
    if len(leakages) == 2 and abs(leakages[0] - leakages[1]) > AGREES * abs(leakages[0]):
        raise ParameterError(
            f"{owner}: Z11 makes motor_leakage {leakages[0]:.6g} 1/(N m s), but Z12 makes it "
            f"{leakages[1]:.6g}; choose load_torque and load_inertia so that both agree, for "
            f"example load_inertia = {Z['Z12'] / (Z['Z10'] * leakages[0]):.12g} kg m²."
        )
    return leakages[0] if leakages else 0.0


def _check_agreement(owner: str, entry: PhysicalValue, made: list[float], why: str) -> None:
    for column, value, follows in zip(entry.quantity.columns, entry.values, made, strict=True):
        if value != follows and not abs(value - follows) <= AGREES * abs(follows):
            raise ParameterError(
                f"{owner}: {column} is given as {value:.9g} {entry.quantity.unit}, but "
                f"{follows:.9g} follows {why}; leave it out or change one of these."
            )
