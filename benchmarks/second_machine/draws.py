"""A machine, its controller and its instruments, drawn for an axis and a seed from levels.toml."""

import tomllib
from dataclasses import dataclass, field
from datetime import datetime
from math import inf, pi
from pathlib import Path

import numpy as np

from .equations import Channel, Condition, Cylinder, Pump, continuous_filter

FOLDER = Path(__file__).parent
LEVELS = tomllib.loads((FOLDER / "levels.toml").read_text("utf-8"))
PUBLISHED = tomllib.loads((FOLDER / "published.toml").read_text("utf-8"))
AXES = ("hoist", "slew", "luff", "cylinder")
SUBJECTS = (
    "parameters",
    "controller",
    "logger",
    "ammeter",
    "encoder",
    "tacho",
    "machine",
    "campaign",
    "runs",
    "stated",
)
"""What is drawn apart from the others: the place in this list is part of the seed."""


def generator(axis, seed, subject):
    """Random generator of a subject of a campaign."""
    return np.random.default_rng([seed, LEVELS["seeds"][axis], SUBJECTS.index(subject)])


def drawn(random, level):
    """A number drawn from a level: a range, or choices."""
    if isinstance(level, dict):
        return level["choices"][random.integers(len(level["choices"]))]
    low, high = level
    return float(random.uniform(low, high))


def drawn_log(random, level):
    """A number drawn from a range, uniformly in the logarithm."""
    low, high = np.log(level)
    return float(np.exp(random.uniform(low, high)))


# --- parameters -----------------------------------------------------------------------------------


def published(axis):
    """Numbers of an axis by name, directions apart (`omega_plus`), the filter's in continuous time.

    C keeps the current that it takes, C/ω².
    """
    pump = PUBLISHED["pump_motor"][axis]
    card = dict(PUBLISHED["control_card"][pump["control_card"]])
    pairs = zip(card["zeta"], card["omega"], strict=True)
    filters = [continuous_filter(zeta, omega) for zeta, omega in pairs]
    ratios = [new / old for (_, new), old in zip(filters, card["omega"], strict=True)]
    card["C"] = [c * ratio**2 for c, ratio in zip(card["C"], ratios, strict=True)]
    card["zeta"] = [zeta for zeta, _ in filters]
    card["omega"] = [omega for _, omega in filters]
    numbers = {}
    for name, value in {**card, **pump}.items():
        if isinstance(value, list):
            numbers[f"{name}_plus"], numbers[f"{name}_minus"] = value
        elif isinstance(value, float):
            numbers[name] = value
    return numbers


def drawn_parameters(axis, seed, stated_spread=0.0):
    """Numbers of a machine by name.

    Parameters
    ----------
    axis : str
        "hoist", "slew" or "luff".
    seed : int
    stated_spread : float
        Standard deviation of the factors on what the tests do not determine and users state. A
        sound campaign has none.
    """
    numbers = published(axis)
    random = generator(axis, seed, "parameters")
    free = determined(axis, numbers)
    for name in free:
        numbers[name] *= drawn(random, LEVELS["parameters"]["factor"])
    if stated_spread:
        random = generator(axis, seed, "stated")
        for name in numbers.keys() - set(free):
            numbers[name] *= 1.0 + stated_spread * float(random.standard_normal())
    return numbers


def determined(axis, numbers):
    """Names of the numbers that the tests of an axis determine."""
    return [
        name
        for symbol in LEVELS["parameters"][axis]
        for name in (symbol, f"{symbol}_plus", f"{symbol}_minus")
        if name in numbers
    ]


def as_read(numbers, gain):
    """Numbers of a machine in the amperes of an ammeter whose gain is off.

    A gain of the ammeter cannot be told from other numbers: these are the ones that make all
    measured signals the same with a right ammeter.
    """
    powers = dict.fromkeys(("J", "G1", "G2", "G3", "C", "lim1", "lim2", "I_t1", "I_t2", "Z17"), 1)
    powers |= {"Z19": -1, "Z20": -2, "Z21": -3, "Z22": -4}
    return {
        name: value * gain ** powers.get(name.partition("_plus")[0].partition("_minus")[0], 0)
        for name, value in numbers.items()
    }


def channel(numbers, direction):
    """One half of the card: "plus" or "minus"."""
    return Channel(*(numbers[f"{name}_{direction}"] for name in Channel._fields))


def pump(numbers):
    """Pump and motor."""
    longer = {"p": "plus", "m": "minus"}
    values = []
    for name in Pump._fields:
        symbol, _, direction = name.partition("_")
        values.append(numbers[f"{symbol}_{longer[direction]}" if direction else symbol])
    return Pump(*values)


def drawn_cylinder(seed):
    """The cylinder of a campaign."""
    random, levels = generator("cylinder", seed, "parameters"), LEVELS["parameters"]
    numbers = levels["cylinder"]
    return Cylinder(*(numbers[name] * drawn(random, levels["factor"]) for name in Cylinder._fields))


# --- controller and instruments -------------------------------------------------------------------


@dataclass(frozen=True)
class Controller:
    """A PLC that holds the command between its tasks."""

    rate: float
    """Tasks a second."""
    phase: float
    """Share of a period between a run's zero and the first task."""
    bits: int
    """Of its analogue output over ±10 V."""


@dataclass(frozen=True)
class Logger:
    """A clock and a converter of the command."""

    rate: float
    """Samples a second, on its own clock."""
    drift: float
    """By which its clock is slow: true time / its own - 1."""
    offset: float
    """Its clock's reading at the run's zero. [s]"""
    jitter: float
    """Standard deviation of the instants of sampling. [s]"""
    stamp_digits: int
    """Decimals of the time in seconds."""
    bits: int
    """Of the command's converter, over ±10 V."""
    noise: float
    """Standard deviation, before the converter. [V]"""
    gain: float
    """Gain of the command's converter. [1]"""
    zero: float
    """Zero of it. [V]"""
    command_delay: float = 0.0
    """By which the command's stamps are late. [s]"""


@dataclass(frozen=True)
class Ammeter:
    """A clamp-on meter around both solenoid leads."""

    gain: float
    zero: float
    """[A]"""
    bandwidth: float
    """First order. [Hz]"""
    noise: float
    """Standard deviation. [A]"""
    resolution: float
    """[A]"""
    ripple: float
    """Amplitude of the driver's ripple, share of the current."""
    ripple_frequency: float
    """[Hz]"""
    limit: float = inf
    """Largest reading. [A]"""


@dataclass(frozen=True)
class Encoder:
    """A quadrature counter behind a play."""

    step: float
    """One count. [rad or m]"""
    edges: tuple[float, float, float, float]
    """Errors of the four edges of a line. [count]"""
    play: float
    """Full width. [rad or m]"""
    delay: float = 0.0
    """By which its readings are late. [s]"""
    fastest: float = inf
    """Counts a second beyond which the counter loses them."""


@dataclass(frozen=True)
class Tacho:
    """A generator on a faster shaft."""

    gain: float
    bandwidth: float
    """First order. [Hz]"""
    noise: float
    """Standard deviation, share of the largest speed."""
    ripple: float
    """Amplitude, share of the speed."""
    cycles: float
    """Cycles of the ripple a turn of the drum."""


def drawn_controller(axis, seed, run):
    """The controller of a campaign, whose tasks run through: each run begins at another phase.

    Parameters
    ----------
    run : str
        Name of a run, as in `run_names`.
    """
    random, levels = generator(axis, seed, "controller"), LEVELS["controller"]
    rate, bits = drawn(random, levels["rate"]), drawn(random, levels["bits"])
    phases = [drawn(random, levels["phase"]) for _ in run_names(axis)]
    return Controller(rate, phases[run_names(axis).index(run)], bits)


def drawn_logger(axis, seed, rate):
    """The logger of a campaign."""
    random, levels = generator(axis, seed, "logger"), LEVELS["logger"]
    return Logger(
        rate=rate,
        drift=1e-6 * drawn(random, levels["drift_ppm"]),
        offset=drawn(random, levels["offset"]),
        jitter=drawn(random, levels["jitter"]),
        stamp_digits=drawn(random, levels["stamp_digits"]),
        bits=drawn(random, levels["bits"]),
        noise=drawn(random, levels["noise"]),
        gain=1.0 + drawn(random, levels["gain_error"]),
        zero=drawn(random, levels["zero_error"]),
    )


def drawn_ammeter(axis, seed):
    """The ammeter of a campaign."""
    random, levels = generator(axis, seed, "ammeter"), LEVELS["ammeter"]
    return Ammeter(
        gain=1.0 + drawn(random, levels["gain_error"]),
        zero=drawn(random, levels["zero_error"]),
        bandwidth=drawn_log(random, levels["bandwidth_log"]),
        noise=drawn(random, levels["noise"]),
        resolution=drawn(random, levels["resolution"]),
        ripple=drawn(random, levels["ripple"]),
        ripple_frequency=drawn(random, levels["ripple_frequency"]),
    )


def drawn_encoder(axis, seed):
    """The encoder of a campaign, or the draw wire of the cylinder."""
    random, levels = generator(axis, seed, "encoder"), LEVELS["encoder"]
    size = drawn(random, levels["edge_error"])
    edges = tuple(float(edge) for edge in random.uniform(-size, size, 4))
    play = drawn(random, LEVELS["machine"][f"play_{axis}"])
    if axis == "cylinder":
        return Encoder(drawn(random, levels["cylinder_resolution"]), edges, play)
    turn = levels[axis] * drawn(random, levels["counts_factor"])
    return Encoder(2.0 * pi / turn, edges, np.deg2rad(play))


def drawn_tacho(axis, seed):
    """The tacho of a campaign; None where it has none."""
    random, levels = generator(axis, seed, "tacho"), LEVELS["tacho"]
    if axis == "cylinder" or random.random() >= levels["share"]:
        return None
    gear = 400 if axis == "slew" else drawn(random, levels["ripple_gear"])
    return Tacho(
        gain=1.0 + drawn(random, levels["gain_error"]),
        bandwidth=drawn_log(random, levels["bandwidth_log"]),
        noise=drawn(random, levels["noise"]),
        ripple=drawn(random, levels["ripple"]),
        cycles=float(gear * drawn(random, levels["ripple_order"])),
    )


# --- runs -----------------------------------------------------------------------------------------


def run_names(axis):
    """Names of a campaign's runs; repetitions end in ", 2"."""
    names = []
    for maneuver, times in LEVELS["campaign"][axis].items():
        names.append(maneuver)
        names.extend(f"{maneuver}, {n}" for n in range(2, times + 1))
    return names


def day(axis, seed):
    """Names of the runs in the order of the day, and the pauses before them. [s]"""
    random = generator(axis, seed, "campaign")
    names = run_names(axis)
    order = [names[k] for k in random.permutation(len(names))]
    return order, [drawn(random, LEVELS["campaign"]["gap"]) for _ in order]


def drawn_conditions(axis, seed):
    """Condition of each run of a drive, in the order of the day.

    The oil's change is zero on average over the runs that are not held out, so that the machine's
    numbers are those of the tests.
    """
    random, levels = generator(axis, seed, "machine"), LEVELS["machine"]
    names, _ = day(axis, seed)
    fixed = {name: drawn(random, levels[name]) for name in (
        "ripple", "ripple_frequency", "hunting", "hunting_frequency", "droop", "hysteresis",
        "shaft_frequency", "shaft_damping",
    )}  # fmt: skip
    orifice = drawn(random, levels["orifice_change"])
    speed = -drawn(random, levels["speed_change"])
    spread = drawn(random, levels["level"])
    time = np.linspace(0.0, 1.0, len(names)) / drawn(random, levels["warming_time"])
    warm = -np.expm1(-time) / -np.expm1(-time[-1])
    fitted = [name not in LEVELS["held_out"][axis] for name in names]
    warm -= np.mean(warm[fitted])
    return [
        Condition(
            orifice=1.0 + orifice * float(share),
            speed=1.0 + speed * float(share),
            level=spread * float(random.standard_normal()),
            ripple_phase=float(random.uniform(0.0, 2.0 * pi)),
            hunting_phase=float(random.uniform(0.0, 2.0 * pi)),
            leakage=0.0,
            **fixed,
        )
        for share in warm
    ]


def drawn_gains(seed):
    """Factor on the cylinder's speed in each run, in the order of the day."""
    random = generator("cylinder", seed, "machine")
    spread = drawn(random, LEVELS["machine"]["supply_cylinder"])
    names, _ = day("cylinder", seed)
    return [1.0 + spread * float(random.standard_normal()) for _ in names]


STEADY = Condition(
    orifice=1.0,
    speed=1.0,
    level=0.0,
    ripple=0.0,
    ripple_frequency=0.0,
    ripple_phase=0.0,
    hunting=0.0,
    hunting_frequency=0.0,
    hunting_phase=0.0,
    droop=0.0,
    hysteresis=0.0,
    shaft_frequency=0.0,
    shaft_damping=0.0,
    leakage=0.0,
)
"""A run in which nothing but the drive's own equations acts."""


# --- a campaign -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Equipment:
    """All that a campaign is made with, as one value: the machine, its instruments, its runs."""

    axis: str
    seed: int
    parameters: dict[str, float]
    """Numbers of the machine by name."""
    conditions: dict[str, Condition | float]
    """Condition by run, in the order of the day; of a cylinder the factor on its speed."""
    stamps: dict[str, float]
    """Time of the log's file by run. [s since 1970]"""
    held_out: tuple[str, ...]
    """Runs that no fit gets."""
    logger: Logger
    encoder: Encoder
    counts_per_turn: float
    """As the encoder's label says; 1 for a cylinder."""
    ammeter: Ammeter | None = None
    tacho: Tacho | None = None
    steady: Condition = STEADY
    """In which new maneuvers are run."""
    elsewhere: dict[str, "Equipment"] = field(default_factory=dict)
    """What logs of runs are filed under this campaign's names by mistake."""


def drawn_equipment(axis, seed, rate=512.0, stated_spread=0.0):
    """The equipment of a sound campaign.

    Parameters
    ----------
    axis : str
        "hoist", "slew", "luff" or "cylinder".
    seed : int
    rate : float
        Samples a second of the logger.
    stated_spread : float
        As of `drawn_parameters`.
    """
    names, gaps = day(axis, seed)
    start = datetime.fromisoformat(LEVELS["campaign"]["start"]).timestamp()
    encoder = drawn_encoder(axis, seed)
    if axis == "cylinder":
        parameters = drawn_cylinder(seed)._asdict()
        conditions, turn, ammeter = drawn_gains(seed), 1.0, None
    else:
        parameters = drawn_parameters(axis, seed, stated_spread)
        conditions, turn = drawn_conditions(axis, seed), 2.0 * pi / encoder.step
        ammeter = drawn_ammeter(axis, seed)
    return Equipment(
        axis=axis,
        seed=seed,
        parameters=parameters,
        conditions=dict(zip(names, conditions, strict=True)),
        stamps=dict(zip(names, start + np.cumsum(gaps), strict=True)),
        held_out=tuple(LEVELS["held_out"][axis]),
        logger=drawn_logger(axis, seed, rate),
        encoder=encoder,
        counts_per_turn=turn,
        ammeter=ammeter,
        tacho=drawn_tacho(axis, seed),
    )
