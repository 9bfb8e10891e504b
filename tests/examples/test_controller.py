"""examples/controller.py: its pendulum and its margins, computed another way."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swashplate import Drive

OMEGA, RADIUS, OWN = np.sqrt(9.81 / 4.0), 15.0, 0.005


@pytest.fixture(scope="module")
def run(run_example: Callable[..., Any]) -> Any:
    return run_example("controller", "--figure", "controller.png")


def test_the_page(run: Any, matches_page: Callable[[str, str], None]) -> None:
    matches_page("controller", run.printed)


@pytest.mark.parametrize("name", ["stick alone", "designed"])
def test_the_load_against_an_adaptive_solver(run: Any, name: str) -> None:
    time, (position, turret) = run.names["TIME"], run.names["runs"][name]

    # p = s' + r Ω, so that Ω need not be differentiated
    def rates(t: float, state: np.ndarray) -> list[float]:
        s, p = state
        speed = p - RADIUS * np.interp(t, time, turret)
        return [speed, -2.0 * OWN * OMEGA * speed - OMEGA**2 * s]

    exact = solve_ivp(rates, (0.0, time[-1]), [0.0, 0.0], t_eval=time, rtol=1e-8, max_step=0.02).y[
        0
    ]
    # first order, half a sample of phase: ω h/2 = 1.6 % of the swing
    assert np.abs(position - exact).max() < 0.02 * np.abs(exact).max()


def margin(damping: float, foretold: float) -> float:
    """The least delay that turns the loop to -1, from the equations; 0 if it is unstable."""
    slew = Drive.preset("slew").parameters.numbers
    f = np.geomspace(1e-3, 20.0, 400_000)
    s = 2j * np.pi * f
    w, lag = slew["omega_plus"], 0.2069  # the lag at 2 V, as Kruse's small motion gives it
    drive = w**2 / (s**2 + 2.0 * slew["zeta_plus"] * w * s + w**2) / (1.0 + lag * s)
    angle = OMEGA * foretold
    sway = (np.cos(angle) + s / OMEGA * np.sin(angle)) * np.exp(-0.3 * s)
    sway *= 2.0 * damping * OMEGA * s / (s**2 + 2.0 * OWN * OMEGA * s + OMEGA**2)
    loop = (1.0 + 1.0 / (lag * s)) * (1.0 + sway) * drive * np.exp(-slew["tau"] * s)
    turned = np.unwrap(np.angle(1.0 + loop))
    if abs(turned[-1] - turned[0]) > np.pi:
        return 0.0
    crossings = np.flatnonzero(np.diff(np.signbit(np.abs(loop) - 1.0)))
    phases = (np.angle(loop[crossings]) + np.pi) % (2.0 * np.pi)
    return float((phases / (2.0 * np.pi * f[crossings])).min())


@pytest.mark.parametrize(
    ("name", "damping", "foretold"),
    [("stick alone", 0.0, 0.3), ("textbook", 1.0, 0.0), ("delay ignored", 0.7, 0.0)]
    + [(name, 0.7, 0.3) for name in ("limits ignored", "dead zone ignored", "designed")],
)
def test_margins_from_the_equations(run: Any, name: str, damping: float, foretold: float) -> None:
    shown = re.search(rf"^{name} +margin ([\d.]+) s", run.printed, re.MULTILINE)
    assert shown is not None
    assert float(shown[1]) == pytest.approx(margin(damping, foretold), abs=0.006)


def test_the_design_is_the_largest_damping_of_its_margin() -> None:
    assert margin(0.7, 0.3) > 0.1 > margin(0.75, 0.3)


def test_what_is_ignored_costs(run: Any) -> None:
    runs, time = run.names["runs"], run.names["TIME"]
    left = {name: np.abs(position[time > 30.0]).max() for name, (position, _) in runs.items()}
    assert all(np.isinf(left[name]) for name in ("textbook", "delay ignored", "limits ignored"))
    assert left["designed"] < 0.005
    assert left["dead zone ignored"] > 5.0 * left["designed"]
    assert left["stick alone"] > 100.0 * left["designed"]
    # held within what the turret can do, ±10 V and its speed limits
    assert np.degrees(np.abs(runs["designed"][1]).max()) <= 4.3
    assert (run.folder / "controller.png").stat().st_size > 20_000
