"""Hysteresis of the solenoids: the force lags behind the current, however slowly it moves."""

from swashplate.physics.component import component


@component
def magnetising_current(current: float, previous: float, solenoid_hysteresis: float) -> float:
    """Current that the solenoids' force belongs to.

    Parameters
    ----------
    current : float
        Signed current at this sample. [A]
    previous : float
        Magnetising current one sample before. [A]
    solenoid_hysteresis : float
        Half-width r of the loop. [A]

    Returns
    -------
    float
        i_m = min(max(i_m, i - r), i + r), the play operator: i - r while the current rises, i + r
        while it falls, unchanged for 2r behind a turn. It does not depend on the rate. [A]

    Notes
    -----
    Whenever i_m moves it lies r behind the current, so that i Δi_m = i_m Δi_m + r |Δi_m|: a closed
    loop takes up energy, never gives it.
    """
    return min(max(previous, current - solenoid_hysteresis), current + solenoid_hysteresis)
