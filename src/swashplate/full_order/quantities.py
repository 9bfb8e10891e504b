"""Every physical quantity of the full-order model: name, symbol, meaning, unit, range."""

from dataclasses import dataclass
from math import inf, isnan, pi

from swashplate.errors import ParameterError


@dataclass(frozen=True)
class Quantity:
    """What a physical quantity is, whatever its value."""

    name: str
    symbol: str
    meaning: str
    unit: str
    directional: bool = False
    lower: float = -inf
    upper: float = inf
    above: bool = False
    """The lower bound itself is excluded."""
    can_be_off: bool = False
    """Infinity is allowed and switches the limit off."""

    @property
    def range(self) -> str:
        """The allowed range as words, e.g. ``above 0``."""
        low = (
            "" if self.lower == -inf else f"{'above' if self.above else 'at least'} {self.lower:g}"
        )
        high = "" if self.upper == inf else f"below {self.upper:g}"
        words = " and ".join(part for part in (low, high) if part) or "any finite number"
        return words + (", or inf for none" if self.can_be_off else "")

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of its values: one, or one for each direction."""
        if self.directional:
            return (f"{self.name}_plus", f"{self.name}_minus")
        return (self.name,)

    def check(self, owner: str, column: str, value: float) -> None:
        """Refuse a value out of range.

        Raises
        ------
        ParameterError
            Naming owner, quantity, value and range.
        """
        low = value <= self.lower if self.above else value < self.lower
        high = value >= self.upper and not (value == inf and self.can_be_off)
        if low or high or isnan(value) or value == -inf:
            unit = "" if self.unit == "1" else f" {self.unit}"
            raise ParameterError(
                f"{owner}: {column} ({self.meaning}) is {value:g}{unit}, but must be {self.range}."
            )


def _positive(name: str, symbol: str, meaning: str, unit: str, **more: float | bool) -> Quantity:
    return Quantity(name, symbol, meaning, unit, lower=0.0, above=True, **more)  # type: ignore[arg-type]


def _magnitude(name: str, symbol: str, meaning: str, unit: str) -> Quantity:
    return Quantity(name, symbol, meaning, unit, lower=0.0)


_QUANTITIES = (
    _positive("spool_arm", "d1", "arm from the pivot to the spool", "m"),
    _positive("spool_mass", "m_sp", "mass of the spool", "kg"),
    _magnitude("feedback_arm_inertia", "J_fa", "inertia of the spool's feedback arm", "kg m^2"),
    _magnitude("spool_damping", "b_sp", "viscous damping of the spool", "N s/m"),
    _positive("feedback_spring_rate", "k_f", "stiffness of the feedback spring", "N/m"),
    _positive("feedback_spring_arm", "d3", "arm of the feedback spring", "m"),
    _positive("control_arm", "d3'", "arm of the ball on the stroking piston", "m"),
    Quantity("plussing", "x0", "spool displacement at rest", "m"),
    _positive("spool_stroke", "x_max", "stroke of the spool, both ways", "m"),
    _positive(
        "orifice_opening",
        "x_o",
        "opening at which the in-line orifice limits the flow",
        "m",
        directional=True,
        can_be_off=True,
    ),
    _positive("valve_flow_gain", "C_o", "flow gain of the valve", "m^2/(s sqrt(Pa))"),
    _positive("supply_pressure", "ΔP", "supply pressure less reservoir pressure", "Pa"),
    _positive("oil_volume", "V", "oil under pressure at the stroking piston", "m^3"),
    _positive("bulk_modulus", "B", "bulk modulus of the oil", "Pa"),
    _magnitude("piston_leakage", "K_L", "leakage around the stroking piston", "m^3/(s Pa)"),
    _positive("piston_area", "A_s", "area of the stroking piston", "m^2"),
    _positive("relief_pressure", "P_r", "pressure of the relief valve", "Pa", can_be_off=True),
    _positive("swash_arm", "d4", "arm of the stroking piston on the swash plate", "m"),
    _positive("swash_inertia", "J_sw", "inertia of the swash plate", "kg m^2"),
    _magnitude("piston_mass", "m_st", "mass of the stroking piston", "kg"),
    _magnitude("piston_damping", "b_st", "viscous damping of the stroking piston", "N s/m"),
    _positive("return_spring_rate", "k_r", "stiffness of the return spring", "N/m"),
    _positive(
        "swash_stop", "α_max", "stop of the swash plate", "rad", directional=True, upper=pi / 2
    ),
    _magnitude("pumping_area", "A_p", "effective area of the pumping pistons", "m^2"),
    _magnitude("pumping_arm", "d5", "arm of the pumping pistons' force on the plate", "m"),
    _positive("motor_constant", "K_mf", "motor speed over flow", "1/m^3"),
    _positive("pump_flow_gain", "C_q", "pump flow over swash angle", "m^3/s"),
    _magnitude("motor_leakage", "K_mL", "motor speed lost over load torque", "1/(N m s)"),
    _magnitude("load_inertia", "C_i", "inertia of the load at the motor", "kg m^2"),
    Quantity("load_torque", "C_g", "static torque of the load, against positive speed", "N m"),
)

QUANTITIES: dict[str, Quantity] = {each.name: each for each in _QUANTITIES}
"""Quantities by name, from the spool to the load."""

CHOICES: dict[str, Quantity] = {
    each.name: each
    for each in (
        _positive("spool_frequency", "ω_sp", "natural frequency of the spool", "rad/s"),
        _magnitude("spool_damping_ratio", "ζ_sp", "damping ratio of the spool", "1"),
        _positive(
            "swash_frequency",
            "ω_sw",
            "natural frequency of the swash plate at held pressure",
            "rad/s",
        ),
        _magnitude("swash_damping_ratio", "ζ_sw", "damping ratio of the swash plate", "1"),
    )
}
"""What may be chosen in place of inertias and dampings when a set is completed."""
