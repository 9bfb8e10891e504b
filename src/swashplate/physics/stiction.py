"""Stiction of solenoid and spool, which dither sets free in time (Kruse 2001, section 7.6).

The friction f holds the spool back against its feedback spring: it stands d = f/k short of the
place at which solenoid and spring balance. It builds up over a short travel of the spool, slides at
F_s, and fades with the time constant T of the dither, which shakes the spool free:

    f' = (F_s/x_s) x' - f/T,  |f| ≤ F_s.

What moves the spool moves it against the friction; a spool that comes to rest is left where
friction holds it, and goes on to its balance as the dither lets go.
"""

from math import exp, sqrt

from swashplate.physics.component import component


@component
def spring_stiffness(Z4: float, Z5: float) -> float:
    """Stiffness of the feedback spring at the spool, √Z4/Z5², of small motion (eq. 6.72). [N/m]"""
    return sqrt(Z4) / (Z5 * Z5)


@component
def stiction_width(spool_friction: float, Z4: float, Z5: float) -> float:
    """How far from its balance friction can hold the spool.

    Parameters
    ----------
    spool_friction : float
        Force F_s at which the spool slides, either way. [N]
    Z4, Z5 : float
        Squared spring moment [N² m²], arm d1 [m].

    Returns
    -------
    float
        w = F_s/k. [m]
    """
    return spool_friction / spring_stiffness(Z4, Z5)


@component
def dither_factor(dither_time: float, step: float) -> float:
    """What dither leaves of a friction in one step, exp(-h/T); 1 without dither."""
    return exp(-step / dither_time)


@component
def held_back(
    deflection: float, balance: float, before: float, width: float, presliding: float, factor: float
) -> float:
    """Distance by which friction holds the spool back from its balance, one step later.

    Parameters
    ----------
    deflection : float
        d one step before, positive where the balance lies further towards more speed. [m]
    balance : float
        Where solenoid and spring balance now. [m]
    before : float
        Where the spool stood one step before. [m]
    width : float
        w, see `stiction_width`; above 0. [m]
    presliding : float
        Travel x_s over which friction builds up to F_s; 0 holds the spool fast. [m]
    factor : float
        See `dither_factor`.

    Returns
    -------
    float
        d = clip((x_s d e^(-h/T) + w (balance - before))/(x_s + w), ±w), the implicit step of the
        equation above; the spool stands at the balance less d. [m]

    Notes
    -----
    The friction's work on the spool is never less than what its travel stores, k x_s d²/(2 w): over
    a closed path it takes energy.
    """
    free = (presliding * (deflection * factor) + width * (balance - before)) / (presliding + width)
    return min(max(free, -width), width)
