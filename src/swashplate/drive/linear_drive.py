"""The linear model of a drive, continuous or at a rate as the march is, with its tables."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from math import log
from typing import Any

import numpy as np

from swashplate.drive.equilibrium import OperatingPoint
from swashplate.drive.instance import drive_instance
from swashplate.drive.signals import UNITS
from swashplate.drive.small_motion import Coulomb, lifted, small_motion_model
from swashplate.errors import DomainError, InputError
from swashplate.machine.linear import LinearModel, with_delay_line
from swashplate.machine.marching import Interpolation, least_substeps
from swashplate.parameters import ParameterSet
from swashplate.results import Result
from swashplate.tables import UNIT, Cell, Column, Table
from swashplate.units import display_unit, in_si

PLATE_STATES = ("stroker_pressure", "plate_pressure", "spool_deflection")
"""States between current and swash angle."""
SHOWN_AT = 0.3
"""Frequency at which a model shows its gain and phase: of a load's swing. [Hz]"""


@dataclass(frozen=True, eq=False, kw_only=True)
class LinearDrive(LinearModel, Result):
    """Small motions of a drive about an operating point.

    Examples
    --------
    >>> from swashplate import Drive
    >>> linear = Drive.preset("hoist").linearize(6.0)
    >>> linear.inputs, linear.outputs, linear.A.shape
    (('voltage',), ('shaft_speed',), (3, 3))
    """

    operating_point: OperatingPoint
    coulomb: Coulomb
    """Whether the card's Coulomb term is left out or counts with its slope at rest."""
    parameters: ParameterSet
    """The drive that was linearised."""

    __repr__ = LinearModel.__repr__

    @property
    def headline(self) -> str:
        """What the fit that the drive comes from says against it; empty if that is usable."""
        doubt = self.parameters.doubt
        return f"The fit of this drive says: {doubt}" if doubt else ""

    def tables(self) -> list[Table]:
        """Operating point, small motion and poles, as of `model_tables`."""
        return model_tables(self, SHOWN_AT)

    def content(self) -> dict[str, Any]:
        """Content of a model's file; see `LinearModel.content`."""
        point = {k: v for k, v in asdict(self.operating_point).items() if v is not None}
        sides = {"coulomb": self.coulomb, "one_sided": list(point.pop("one_sided"))}
        # tables last, as TOML has them
        return {**super().content(), **sides, "operating_point": point}

    @property
    def time_constant(self) -> float:
        """Time constant of the pump's lag, from current to swash angle. [s]

        At rest without plussing τ = (1 + Z6)/(Z1 Z3 Z5 Z8 √(Z9/2)); Kruse (2001), eqs. 6.72-6.74
        with errata 4 and 23. Of a sampled model that of the lag with the same pole; one that is
        shorter than its step is refused in a `DomainError`. Where friction or damping give it more
        poles than one, that of the slowest.
        """
        slowest = self.poles_of(*PLATE_STATES)[0]
        if self.rate is None:
            return -1.0 / float(slowest.real)
        pole = float(abs(slowest) if slowest.imag else slowest.real)
        if not 0.0 < pole < 1.0:
            raise DomainError(
                f"{self.name}: sampled at {self.rate:g} Hz the pump's pole is at z = {pole:g}, "
                "which is not that of a lag; use a higher rate."
            )
        return -1.0 / (self.rate * log(pole))

    def discrete(self, rate: float, interpolation: Interpolation = "linear") -> LinearDrive:
        """The model at a rate, with the recurrences of the march.

        Agrees with a small motion of `Drive.simulate` or `Drive.stepper` sample for sample.

        Parameters
        ----------
        rate : float
            Samples a second, 10 Hz to 100 kHz; below 512 Hz the march's own sub-steps are taken.
            [Hz]
        interpolation : {"linear", "previous"}
            What the input is between samples, as in `Drive.simulate`: a straight line or held.

        Returns
        -------
        LinearDrive
            Sampled, with the card's delay as whole samples or as states.

        Raises
        ------
        InputError
            For another rate, or one at which the card's filter is unstable.
        """
        if interpolation not in ("linear", "previous"):
            raise InputError(f"interpolation is '{interpolation}'; it is 'linear' or 'previous'.")
        rate = in_si(rate, "Hz", "The rate")
        substeps = least_substeps(rate)
        if self.input == "voltage":
            machine = drive_instance(self.parameters, by_voltage=True)
            machine.check_step(1.0 / (rate * substeps))
        fine = small_motion_model(
            self.parameters,
            self.operating_point,
            self.inputs,
            self.outputs,
            self.coulomb,
            rate * substeps,
        )
        sampled = replace(
            self,
            A=fine.A,
            B=fine.B,
            C=fine.C,
            D=fine.D,
            states=fine.states,
            memory=fine.memory,
            delay=fine.delay,
            rate=rate,
        )
        if substeps == 1:
            return sampled
        delay_samples = round(fine.delay * rate * substeps)
        line = tuple(f"{self.input}_{k}" for k in range(1, delay_samples + 1))
        last = tuple(f"{name}_last" for name in self.inputs)
        # a measured input goes straight from sample to sample
        zero_order = [interpolation == "previous", *(False for _ in self.inputs[1:])]
        A, B, C, D = with_delay_line((fine.A, fine.B, fine.C, fine.D), delay_samples)
        A, B, C, D = lifted(A, B, C, D, substeps, zero_order)
        return replace(
            sampled,
            A=A,
            B=B,
            C=C,
            D=D,
            states=(*line, *fine.states, *last),
            memory=(*line, *fine.memory, *last),
            delay=0.0,
        )


# --- tables ---------------------------------------------------------------------------------------


def model_tables(
    model: LinearDrive, frequency: float, loop_gain: float | None = None
) -> list[Table]:
    """Operating point, small motion and poles of a model, and margins of a loop closed over it.

    Small motion and margins are of a model whose first output is the shaft's speed. Gain and phase
    are given at `frequency` [Hz]; `loop_gain` is that of a proportional speed loop
    [V, A or N / (rad/s)].
    """
    point = model.operating_point
    unit = UNITS[model.input]
    answer = complex(model.response(frequency)[0])
    at = f"at {frequency:g} Hz"
    operating = _key_values("Operating point")
    if point.voltage is not None:
        operating.add("voltage", point.voltage, unit="V")
    operating.add("current", Cell(point.current, f"{point.current:z.4f}"), unit="A")
    operating.add("swash angle", point.swash_angle, unit="rad", spec="z.3f")
    operating.add("shaft speed", point.shaft_speed, unit="rad/s", spec="z.3f")

    if model.outputs[0] != "shaft_speed":
        return [operating, _poles_table(model)]
    moving = _key_values("Small motion")
    moving.add("steady gain", model.gain, unit=f"rad/s/{unit}", spec="z.5g")
    try:
        lag: float | Cell = model.time_constant
    except DomainError:
        lag = Cell(None, "shorter than a sample")
    moving.add("time constant of the pump", lag, unit="s")
    if model.input == "voltage":
        delay = 1e3 * model.parameters.numbers["tau"]
        moving.add("delay of the card", delay, unit="ms", spec="z.3f")
    if model.input in ("voltage", "current") and "late" in model.parameters.options:
        for name, word in (("solenoid_delay", "delay"), ("solenoid_lag", "lag")):
            late = 1e3 * model.parameters.numbers.get(name, 0.0)
            moving.add(f"{word} of the solenoids", late, unit="ms", spec="z.3f")
    moving.add("bandwidth (-3 dB)", _none_if_infinite(model.bandwidth), unit="Hz", spec=".4g")
    moving.add(f"gain {at}", abs(answer), unit=f"rad/s/{unit}", spec=".5g")
    moving.add(f"phase {at}", float(np.angle(answer, deg=True)), unit="deg", spec="z.2f")
    largest = _none_if_infinite(model.largest_gain)
    moving.add("largest proportional gain", largest, unit=f"{unit}/(rad/s)", spec=".4g")

    poles = _poles_table(model)
    if loop_gain is None:
        return [operating, moving, poles]
    margins = model.margins(loop_gain)
    display = display_unit(f"{unit}/(rad/s)")
    loop = _key_values(f"Proportional loop, {display.factor * loop_gain:g} {display.name}")
    loop.add("crossover", margins.crossover or Cell(None, "none"), unit="Hz", spec=".4g")
    loop.add(
        "phase margin", _none_if_infinite(np.degrees(margins.phase_margin)), unit="deg", spec=".1f"
    )
    loop.add("delay margin", _none_if_infinite(1e3 * margins.delay_margin), unit="ms", spec=".2f")
    loop.add("gain margin", _none_if_infinite(margins.gain_margin), spec=".3g")
    return [operating, moving, poles, loop]


def _poles_table(model: LinearDrive) -> Table:
    """Poles without those of delays, of two conjugate ones the upper."""
    columns = (
        Column("Poles"),
        Column("real", "z.5g"),
        Column("imaginary", "s"),
        Column("Hz", ".4g"),
        Column("damping", ".3f"),
    )
    poles = Table("", columns)
    rate = model.rate
    for pole in model.poles[model.poles.imag >= 0.0]:
        s = pole if rate is None else np.log(pole) * rate
        size = float(abs(s))
        imaginary = f"±{pole.imag:.5g}" if pole.imag else ""
        poles.add(
            "rad/s" if rate is None else "z",
            float(pole.real),
            imaginary,
            size / (2.0 * np.pi),
            float(-s.real) / size,
        )
    return poles


def _key_values(title: str) -> Table:
    return Table("", (Column(title), Column("", "z.4f", none="no limit"), UNIT))


def _none_if_infinite(margin: float) -> float | None:
    return None if np.isinf(margin) else float(margin)
