"""SciPy's stiff solver on the five states' rates, restarted at every event: the trusted path."""

import numpy as np
from scipy.integrate import solve_ivp

from swashplate.drive import Simulation
from swashplate.full_order import FullOrderDrive
from swashplate.models.displacement_control import solenoid_force
from swashplate.models.full_order import Motion, free_rates
from swashplate.models.machine import relief_pressures

SLACK = 1e-9
"""Part of its range by which a state passes a limit before it counts: more than rounding."""
TOLERANCES = np.array([1e-9, 1e-7, 1.0, 1e-9, 1e-7])  # m, m/s, Pa, rad, rad/s for 1e-6.

ROUNDING = 1e-7
"""Time within which two events are one. [s]"""


def solved(full: FullOrderDrive, run: Simulation, tolerance: float = 1e-8) -> np.ndarray:
    """(n, 5) states over the current of a run, a straight line between its samples.

    A limit that holds is -1 or 1, one that does not is 0: the spool at its stroke, the relief valve
    open, the plate at a stop. Stops are inelastic.
    """
    m, current = full.plant.machine, run.fine("current")
    instance = full.by_current
    options = instance.options[1]
    started = instance.start({"current": float(current[0])}, run.record.step, "rest")
    state = np.array(started.states[1].motion)
    relief = relief_pressures(m)
    time = run.record.step * np.arange(current.size)
    lower = np.array([-m.spool_stroke, relief.lower, -m.swash_stop_minus])
    upper = np.array([m.spool_stroke, relief.upper, m.swash_stop_plus])
    size, places = upper - lower, [0, 2, 3]
    rates_of, force_of = free_rates, solenoid_force

    def pushes(t: float, y: np.ndarray) -> np.ndarray:
        """Rates of spool velocity, pressure and swash rate where no limit holds."""
        force = force_of(float(np.interp(t, time, current)), full.plant.solenoids)
        return np.array(rates_of(Motion(*y.tolist()), force, m, options))

    def rates(t: float, y: np.ndarray, holds: np.ndarray) -> np.ndarray:
        free = np.where(holds == 0, pushes(t, y), 0.0)
        return np.array([y[1], free[0], free[1], y[4], free[2]])

    def margin(number: int, holds: np.ndarray):
        """How far a limit is from being reached, or from letting go."""

        def of(t: float, y: np.ndarray, _: np.ndarray) -> float:
            if holds[number]:
                return float(holds[number] * pushes(t, y)[number])
            at = y[places[number]]
            return float(min(upper[number] - at, at - lower[number]) / size[number]) + SLACK

        of.terminal, of.direction = True, -1  # type: ignore[attr-defined]
        return of

    def settled(t: float, y: np.ndarray, let_go: np.ndarray) -> np.ndarray:
        """Which limits hold from here on; what arrives at one is set on it, and stops."""
        speed, near = np.array([y[1], 0.0, y[4]]), 2.0 * SLACK * size
        side = np.where(y[places] >= upper - near, 1, np.where(y[places] <= lower + near, -1, 0))
        side = np.where(side * speed >= 0.0, side, 0)
        y[places] = np.where(side > 0, upper, np.where(side < 0, lower, y[places]))
        y[[1, 4]] = np.where(side[[0, 2]] != 0, 0.0, y[[1, 4]])
        return np.where((side * pushes(t, y) >= 0.0) & ~let_go, side, 0)

    found, now, events = np.empty((time.size, 5)), 0.0, 0
    let_go = np.zeros(3, dtype=bool)
    while now < time[-1]:
        holds = settled(now, state, let_go)
        later = time[time >= now]
        made = solve_ivp(
            rates,
            (now, time[-1]),
            state,
            "Radau",
            later,
            events=[margin(number, holds) for number in range(3)],
            args=(holds,),
            max_step=run.record.step,
            rtol=tolerance,
            atol=TOLERANCES * (tolerance / 1e-6),
        )
        assert made.status >= 0, made.message
        if len(made.t):
            found[time.size - later.size :][: len(made.t)] = made.y.T
        if made.status == 0:
            break
        # what has let go is not held again by rounding, neither at once nor at the next event there
        moved = max(float(each[0]) for each in made.t_events if each.size) - now
        released = np.array([bool(each.size) for each in made.t_events]) & (holds != 0)
        let_go = released | (let_go & (moved < ROUNDING))
        events += 1
        assert events < 1000, f"the limits chatter at {now:g} s"
        now = max(float(each[0]) for each in made.t_events if each.size)
        state = next(each[0] for each in made.y_events if each.size).copy()
    return found
