"""What is written down, not measured or fitted: runs, linearised fits, noise, a fit setup."""

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter

from swashplate import Campaign, Channel, Experiment, rig
from swashplate.campaign import InputSignal, SignalOrigin
from swashplate.executors import Serial
from swashplate.identification import FitSetup, Unknown, Unknowns
from swashplate.identification.estimation.arrow import RunRows
from swashplate.identification.estimation.problem import (
    TOLERANCE,
    LinearisedFit,
    LinearisedRun,
    factor_of,
)

UNITS = {
    "voltage": "V",
    **dict.fromkeys(("current", "signed_current", "rectified_current", "current_plus"), "A"),
    "current_minus": "A",
    "shaft_speed": "rad/s",
    "position": "rad",
}


def run_of(
    name: str,
    values: np.ndarray,
    channels: Mapping[str, np.ndarray],
    *,
    time: np.ndarray | None = None,
    kind: str = "voltage",
    hold: str = "linear",
    noise: float | None = None,
    weight: float = 1.0,
    role: str = "fit",
    start: str = "rest",
    maneuver: str = "",
) -> Experiment:
    """A run without a file, at 512 Hz or given stamps; channels have the names of their kinds."""
    time = np.arange(values.size) / 512.0 if time is None else time
    source, made = SignalOrigin(Path("log.csv"), "column"), {}
    for key, each in channels.items():
        own, size = key if key in UNITS and kind != "other" else "other", np.size(each)
        at, weights = time[:size], np.full(size, weight)
        unit = UNITS.get(own, "1")
        made[key] = Channel(key, own, unit, at, each, weights, source, noise=noise)
    given = InputSignal(kind, UNITS.get(kind, "1"), time, values, hold, source)
    return Experiment(name, "hoist", name, role, start, None, given, made, maneuver)


TIME = np.linspace(0.0, 4.0, 81)


Formula = Callable[[Mapping[str, float], np.ndarray, float], np.ndarray]
"""y from the values, y's time stamps and the last sample of the input."""


def bench_run(name: str, level: float, y: np.ndarray, **more: object) -> Experiment:
    """A run of another machine at an input level, with given samples of y."""
    how = {"time": TIME, "kind": "other", "hold": "previous", **more}
    return run_of(name, np.full(TIME.size, level), {"y": y}, **how)


def model_of(formula: Formula) -> SimpleNamespace:
    """A model without derivatives."""

    def simulate(values: Mapping[str, float], run: Experiment) -> dict[str, np.ndarray]:
        return {"y": formula(values, run["y"].time, run.input.values[-1])}

    return SimpleNamespace(simulate=simulate)


def risen(level: float, gain: float, lag: float, time: np.ndarray = TIME) -> np.ndarray:
    """gain · level · (1 - exp(-t/lag))."""
    return gain * level * (1.0 - np.exp(-time / lag))


RISE = model_of(lambda values, time, level: risen(level, values["gain"], values["lag"], time))


def unknowns_of(
    names: Sequence[str],
    values: ArrayLike,
    *,
    scales: ArrayLike | None = None,
    logarithmic: Sequence[bool] | None = None,
    at_bound: Sequence[int] | None = None,
) -> Unknowns:
    """Unknowns at their estimates: -1 at the lower bound, 1 at the upper one, 0 between."""
    number = np.asarray(values, dtype=float)
    size = np.where(number == 0.0, 1.0, np.abs(number)) if scales is None else np.asarray(scales)
    items = []
    for k, (name, value, scale) in enumerate(zip(names, number, size, strict=True)):
        log, side = bool(logarithmic and logarithmic[k]), at_bound[k] if at_bound else 0
        low, high = (value / 1e9, value * 1e9) if log else (value - scale, value + scale)
        low, high = (value if side < 0 else low), (value if side > 0 else high)
        items.append(Unknown(name, float(value), low, high, log=log, scale=float(scale)))
    return Unknowns(tuple(items))


def linear_fit(
    runs: Sequence[LinearisedRun],
    derivatives: Sequence[np.ndarray],
    variables: Unknowns,
    *,
    prior: np.ndarray | None = None,
    prior_noise: np.ndarray | None = None,
    tolerance: float = TOLERANCE,
) -> LinearisedFit:
    """A fit of some runs, by unknowns of the machine alone; without priors by default."""
    rows = np.zeros((0, len(variables))) if prior is None else prior
    noise = np.ones(len(rows)) if prior_noise is None else prior_noise
    priors = [RunRows("", np.arange(0), row[None, :]) for row in rows]
    factor = factor_of(zip(runs, derivatives, strict=True), variables, priors)
    return LinearisedFit(tuple(runs), derivatives, variables, factor, rows, tolerance, noise)


def first_order(
    rho: float, rng: np.random.Generator, size: tuple[int, ...], warm: int = 1000
) -> np.ndarray:
    """Noise of variance 1 with the autocorrelation ρ^|k| along the last axis."""
    drawn = rng.normal(size=(*size[:-1], size[-1] + warm))
    return lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], drawn)[..., warm:]


def virtual(folder: Path, *tests: object, **options: object) -> Campaign:
    """Virtual tests, written into a folder and read again."""
    return Campaign.from_toml(rig.write(rig.run(*tests, **options), folder / "virtual"))


class Backwards(Serial):
    """Results in another order than asked for, as from several processes."""

    def run(self, function, shared, items):
        yield from reversed(list(super().run(function, shared, items)))


def put(pattern: str, new: str, count: int = 0) -> Callable[[str], str]:
    """A change of a file's text: what spoils it."""
    return lambda text: re.sub(pattern, new, text, count=count)


LATER = {"from": 1.0, "to": 1.2, "factor": 10.0}
KNOWN = {"relative": (0.8, 1.25), "log": True, "prior": {"mean": 12.8, "deviation": 0.05}}
FEW = FitSetup.model_validate(
    {
        "title": "few numbers",
        "part": "chain",
        "free": {"J": {"relative": (0.5, 2.0)}, "Z10": KNOWN},
        "weights": {"rectified_current": [LATER]},
    }
)
"""A jump of the card and a number of the pump, through the whole chain."""


WIDE = {"relative": (0.5, 2.0)}
POSITIVE = WIDE | {"log": True}
LARGER = {"relative": (0.8, 2.0), "log": True}
BEND = {"relative": (-5.0, 5.0)}
DEAD_ZONE = {"relative": (0.85, 1.15)}
CARDS: Mapping[str, Mapping[str, Mapping[str, object]]] = {
    "hoist": dict.fromkeys(("V_dz", "J", "G1"), WIDE)
    | dict.fromkeys(("G2", "G3"), BEND)
    | dict.fromkeys(("zeta", "omega", "lim1", "lim2"), POSITIVE)
    | {"I_t1": WIDE, "a": POSITIVE},
    "slew": dict.fromkeys(("V_dz", "J", "G1"), WIDE)
    | dict.fromkeys(("zeta_plus", "omega_plus", "C_plus", "lim2_plus", "a"), POSITIVE),
    "luff": dict.fromkeys(("V_dz", "J", "G1"), WIDE)
    | dict.fromkeys(("zeta_plus", "omega_plus", "C_plus"), POSITIVE)
    | dict.fromkeys(("lim1_plus", "lim2_plus", "a"), POSITIVE),
}
"""What Kruse's tests determine of the cards: downwards a slew and a luff have sines alone."""
PUMPS: Mapping[str, Mapping[str, Mapping[str, object]]] = {
    "hoist": dict.fromkeys(("Z1", "Z3", "Z8", "Z16_plus"), LARGER)
    | {
        "Z10": {"relative": (0.88, 1.14), "log": True},
        "Z13_plus": {"relative": (0.8, 1.4), "log": True},
        "Z13_minus": {"relative": (0.3, 3.0), "log": True},
        "Z16_minus": {"relative": (0.5, 10.0), "log": True},
        "Z17": DEAD_ZONE,
    },
    "slew": {
        "Z8": POSITIVE,
        "Z13": POSITIVE,
        "Z17": DEAD_ZONE,
        "Z19": POSITIVE,
        "Z21": {"bounds": (-20.0, 20.0)},
    },
    "luff": {
        "Z8": POSITIVE,
        "Z16": {"relative": (0.5, 3.0), "log": True},
        "Z17": DEAD_ZONE,
        "Z19": POSITIVE,
    },
}
"""And of pump and motor: Z4 to Z6 and Z9 are scales that no speed tells. Without a spool offset the
arm ratio Z3 and the forces can hardly be told apart, nor Z10 and the angles, nor Z1 and Z8."""
FORCES = {
    "plus": (0.06, 0.16, 0.28, 0.40),
    "minus": (0.06, 0.16, 0.28, 0.38),
    "relative": (0.8, 2.0),
}
"""Of the hoist's solenoids: beyond the dead zone, up to the speed's saturation."""


def determined_of(axis: str, part: str = "chain", **entries: object) -> FitSetup:
    """A fit setup of what Kruse's tests determine of an axis: of its card, its pump or both."""
    free = {**(CARDS[axis] if part != "pump" else {}), **(PUMPS[axis] if part != "card" else {})}
    forces = FORCES if axis == "hoist" and part != "card" else None
    content = {"part": part, "free": free, "forces": forces, **entries}
    return FitSetup.model_validate(content)
