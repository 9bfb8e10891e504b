"""What the march needs to know of a parameter set: plain tuples of floats.

Numba hands named tuples to compiled code by value, so that in the march a parameter reads as
``pump.Z8`` and costs nothing. An option is None or True, never False: the two are different types,
and the compiler removes the branch that is not taken.
"""

from typing import NamedTuple


class Channel(NamedTuple):
    """One channel of the control card; units as in `swashplate.parameters.catalogue`."""

    V_dz: float
    J: float
    G1: float
    G2: float
    G3: float
    zeta: float
    omega: float
    C: float
    lim1: float
    lim2: float
    I_t1: float
    I_t2: float
    a: float
    decay: float
    """exp(-a h)."""
    literal: bool | None
    """True: literal Coulomb sign."""
    split: bool | None
    """True: the decay takes over within a step, where the current passes I_t2."""


class Delay(NamedTuple):
    """The card's delay τ in samples of the march, whole and fraction apart."""

    whole: int
    fraction: float
    share_whole: int
    """Whole samples from now back to the end of the interval over which the share s is taken."""
    share_fraction: float
    share_moves: float
    """1.0, or 0.0 where τ < h/2 and the interval is held back so as not to look ahead."""


class Pump(NamedTuple):
    """Pump and motor; units as in `swashplate.parameters.catalogue`."""

    Z1: float
    Z2: float
    Z3: float
    Z4: float
    Z5: float
    Z6: float
    Z7: float
    Z8: float
    Z9: float
    Z10: float
    Z11: float
    Z12: float
    Z13_plus: float
    Z13_minus: float
    Z14: float
    Z15: float
    Z16_plus: float
    Z16_minus: float
    Z17: float
    Z18: float
    Z19_plus: float
    Z19_minus: float
    Z20_plus: float
    Z20_minus: float
    Z21_plus: float
    Z21_minus: float
    Z22_plus: float
    Z22_minus: float
    lower_stop: float
    upper_stop: float
    lower: float
    upper: float
    leaky: bool | None
    """True: Z7 is not zero and the pressure is integrated by Runge-Kutta."""
    loaded: bool | None
    """True: Z12 is not zero and the speed depends on the swash plate's rate."""
    steep: bool | None
    """True: a stop of the swash plate lies beyond 22.5°."""
    symmetric: bool | None
    """True: root √((Z9 - sgn(x)δP)/2)."""


CHANNEL_PARAMETERS = Channel._fields[:13]
PUMP_PARAMETERS = Pump._fields[:28]
N_CHANNEL_NUMBERS = 14
"""Numbers in `Channel`, parameters and what follows from them."""
N_PUMP_NUMBERS = 32
"""Numbers in `Pump`."""
