"""What a simulation with refinements returns: the plain signals, and those of the load."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from swashplate.simulation.limits import Limit
from swashplate.simulation.march import integrate
from swashplate.simulation.refined_march import RefinedSignals
from swashplate.simulation.result import Inside, Simulation, read_only

if TYPE_CHECKING:
    import polars

Array = NDArray[np.float64]
Flags = NDArray[np.uint8]


@dataclass(frozen=True, eq=False, kw_only=True)
class RefinedSimulation(Simulation):
    """Signals of a record simulated with refinements; as `Simulation`, with torque and pressure."""

    refined: RefinedSignals
    """What the march left on its grid."""
    knows_pressure: bool = False
    """Whether a motor_constant is given, which makes a pressure drop of the torque."""

    def fine(self, signal: str) -> Array:
        """A signal on the march's grid, `substeps` points a sample.

        Parameters
        ----------
        signal : str
            One of `SIGNALS` from the current on, or ``"current_sum"``.
        """
        if self.card is None:
            plus = np.maximum(self.record.values, 0.0)
            minus = np.maximum(-self.record.values, 0.0)
        else:
            plus, minus = self.card.current_positive, self.card.current_negative
        inner = self.refined
        Z14, Z16 = self.pump.Z14, (self.pump.Z16_plus, self.pump.Z16_minus)
        match signal:
            case "current":
                return plus - minus
            case "current_sum":
                return plus + minus
            case "current_positive":
                return plus
            case "current_negative":
                return minus
            case "solenoid_force":
                return inner.force
            case "spool_position":
                return np.clip(inner.position, -Z14, Z14)
            case "orifice_opening":
                return np.clip(inner.position, -min(Z14, Z16[1]), min(Z14, Z16[0]))
            case "stroker_pressure":
                return inner.pressure
            case "swash_angle":
                return inner.angle
            case "shaft_speed":
                return inner.speed
            case "shaft_position":
                position = np.empty_like(inner.speed)
                integrate(inner.speed, self.record.step, 0.0, position)
                return position
        raise AttributeError(signal)

    @cached_property
    def _fine_speed(self) -> Array:
        return self.refined.speed

    @cached_property
    def _inside(self) -> Inside:
        return Inside(*(read_only(self._sampled(self.fine(name))) for name in Inside._fields))

    @cached_property
    def motor_torque(self) -> Array:
        """Torque that the motor bears, positive where it drives towards positive speed. [N m]"""
        return read_only(self._sampled(self.refined.torque))

    @cached_property
    def motor_pressure_drop(self) -> Array | None:
        """P_hi - P_lo over the motor, None where no motor_constant is given. [Pa]"""
        if not self.knows_pressure:
            return None
        return read_only(self._sampled(self.refined.pressure_drop))

    @cached_property
    def limits(self) -> Flags:
        """Limits that act at each sample, bits of `Limit`; as of `Simulation`."""
        pump = self.pump
        free, p = self._sampled(self.refined.position), self.stroker_pressure
        current = self._sampled(self.refined.current)
        orifice = np.where(free > 0.0, pump.Z16_plus, pump.Z16_minus)
        held = ((p >= pump.upper) & (free > 0.0)) | ((p <= pump.lower) & (free < 0.0))
        relief = ((p >= pump.upper) & (pump.upper < pump.upper_stop)) | (
            (p <= pump.lower) & (pump.lower > pump.lower_stop)
        )
        active = {
            Limit.DEAD_ZONE: np.abs(current) <= pump.Z17,
            Limit.ORIFICE: (np.minimum(np.abs(free), pump.Z14) > orifice) & ~held,
            Limit.SPOOL: np.abs(free) > pump.Z14,
            Limit.SWASH_STOP: (p >= pump.upper_stop) | (p <= pump.lower_stop),
            Limit.RELIEF: relief,
        }
        if self.card is not None:
            active[Limit.CURRENT_RATE] = self._sampled(self.card.rate_limited) > 0
        flags = np.zeros(p.size, dtype=np.uint8)
        for limit, mask in active.items():
            flags[mask] |= int(limit)
        return read_only(flags)

    def to_polars(self) -> polars.DataFrame:
        """Table of `Simulation.to_polars` with the motor's torque and, if known, pressure drop."""
        import polars as pl

        columns = {"motor_torque": self.motor_torque}
        if self.motor_pressure_drop is not None:
            columns["motor_pressure_drop"] = self.motor_pressure_drop
        return super().to_polars().with_columns(*(pl.Series(k, v) for k, v in columns.items()))
