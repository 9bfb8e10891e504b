"""The crane beside an independent one: residual swing, and swing in seaways with intervals.

python benchmarks/crane_tables.py [--seeds 200] [--write]   (writes docs/crane-checks.md)

The other crane is a prototype that shares no code with this one; its numbers are copied here.
"""

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from swashplate.crane import (
    SEA_STATES,
    Crane,
    Estimate,
    Hull,
    Seaway,
    Setup,
    Spectrum,
    Stick,
    TransferFunctions,
    control,
    judge,
    load_motion,
    read_ship,
    simulate,
)
from swashplate.crane.control import Control
from swashplate.crane.judgment import mean_of
from swashplate.crane.stepper import Actuation
from swashplate.executors import Threads

PAGE = Path(__file__).parent.parent / "docs" / "crane-checks.md"
S175 = Path(__file__).parents[2] / "shared" / "data" / "s175" / "input.re1"
LENGTH, START = 240.0, 60.0
"""Of a seaway, and from when on swing counts. [s]"""
FACTORS = (1.0, 1.5, 2.0, 3.0, 5.0)
OTHERS = (1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0, 10.0)

FEEDBACK = control.DelayedFeedback(0.2, delay=0.2)
MEANT = FEEDBACK | control.ShipCompensation() | control.PositionLoop(1.5)
CLIPPED = FEEDBACK | control.ShipCompensation() | control.Clip()
ALONE = FEEDBACK | control.Clip(0.25)
"""Designed for ideal drives; clipped at 0.8 of what the luff can follow; feedback alone."""

UNDAMPED = 0.0
"""Damping ratio of the other crane's load."""
PEAK = 3.3
"""Peak factor of the other crane's seas, as its ships' motions say."""
MOTIONS = {  # sway, heave [m], roll [deg] of the other crane, significant single amplitudes
    ("S175", "ss3"): (0.22, 0.46, 0.08),
    ("S175", "ss3-swell"): (0.32, 0.48, 0.19),
    ("S175", "ss4"): (0.56, 1.07, 0.23),
    ("rolls at 13 s", "ss3"): (None, None, 0.6),
    ("rolls at 13 s", "ss3-swell"): (None, None, 1.8),
    ("rolls at 13 s", "ss4"): (None, None, 1.9),
}
SEAS = {  # none, ideal, meant at FACTORS, clipped at FACTORS, feedback alone [deg RMS]
    "ss3": (
        *(2.49, 0.00, 10.87, 1.12, 0.11, 0.07, 0.07),
        *(1.07, 0.46, 0.15, 0.11, 0.11, 0.69),
    ),
    "ss3-swell": (
        *(10.83, 0.00, 16.64, 0.16, 0.11, 0.10, 0.10),
        *(1.38, 0.43, 0.19, 0.17, 0.17, 1.86),
    ),
    "ss4": (
        *(11.37, 0.47, 18.58, 15.12, 7.06, 2.13, 1.10),
        *(4.46, 3.28, 2.42, 1.59, 0.98, 4.11),
    ),
}
ROLLING = (  # none, ideal, meant at OTHERS, clipped at OTHERS
    *(4.21, 0.61, 17.8, 13.9, 9.6, 4.3, 2.9, 2.3, 1.6, 1.2, 1.0),
    *(3.0, 3.0, 2.8, 2.2, 1.85, 1.6, 1.3, 0.9, 0.8),
)


def measured(
    crane: Crane, sea: Seaway, seeds: range, factors: tuple[float, ...], alone: bool
) -> dict[str, np.ndarray]:
    """(n,) root mean square swing of each variant in each seaway. [deg]"""
    larger = {x: crane.with_drive(luff=crane.luff.scale(Z16=x)) for x in factors}
    sets: dict[str, tuple[Control, dict[str, str | Crane]]] = {
        "ideal": (MEANT, {"ideal drives": "ideal"}),
        "meant": (MEANT, {f"meant for ideal, orifice ×{x:g}": each for x, each in larger.items()}),
        "clipped": (CLIPPED, {f"clipped, orifice ×{x:g}": each for x, each in larger.items()}),
    }
    if alone:
        sets["alone"] = (ALONE, {"feedback alone, clip 0.25 m": crane})
    made: dict[str, np.ndarray] = {}
    for law, drives in sets.values():
        found = judge(
            crane, law, sea=sea, seeds=seeds, drives=drives, length=LENGTH, start=START,
            remedies=False, executor=Threads(2), swing_damping=UNDAMPED,
        )  # fmt: skip
        made |= {name: np.degrees(found.counted(name)) for name in found.names}
    return made


def seaway_rows(
    found: Mapping[str, np.ndarray], others: tuple[float, ...], random: np.random.Generator
) -> Iterator[str]:
    """A row for each variant: our mean and interval, the other's, and where such means of 4 lie."""
    none = found["no control"]
    for (name, values), other in zip(found.items(), others, strict=True):
        mean = mean_of(values)
        fours = np.sort(values[random.integers(0, values.size, (20_000, 4))].mean(axis=1))
        low, high = fours[[500, 19_499]]
        # both are printed to two decimals, of which the last may be rounded
        within = "yes" if low - 0.005 <= other <= high + 0.005 else "no"
        less = "" if name == "no control" else interval(mean_of(values - none), "+.2f")
        yield (
            f"| {name} | {interval(mean, '.2f')} | {less} | {other:g} | {low:.2f} to {high:.2f} "
            f"| {within} |"
        )


def interval(estimate: Estimate, spec: str) -> str:
    """A mean with its interval."""
    low, high = format(estimate.low, spec), format(estimate.high, spec)
    return f"{estimate.value:{spec}} ({low} to {high})"


def seaway_tables(crane: Crane, count: int) -> Iterator[str]:
    """Swing of a load kept abeam in beam seas: the other crane's seaways, then the package's."""
    random, seeds = np.random.default_rng(0), range(count)
    hulls: dict[str, Hull | TransferFunctions] = {"rolls at 13 s": Seaway().ship}
    if S175.exists():
        hulls["S175"] = read_ship(S175)
    yield from motion_rows(hulls)
    yield from same_rows(crane, hulls)
    yield from none_rows(crane, 5 * count, hulls)
    head = (
        "| variant | this crane, mean (95 %) | less no control (95 %) | other crane, 4 seaways | "
        "95 % of means of 4 of ours | within |\n|---|---|---|--:|---|---|"
    )
    for (hull, name), others in studied(hulls).items():
        print(hull, name, flush=True)
        found = measured(crane, Seaway(name, ship=hulls[hull]), seeds, *variants(hull))
        yield f"\n### {hull}, {name}, {count} seaways\n\n{head}"
        yield from seaway_rows(found, others, random)


def studied(
    hulls: Mapping[str, Hull | TransferFunctions],
) -> dict[tuple[str, str], tuple[float, ...]]:
    """The other crane's numbers by hull and sea, of hulls that are there."""
    made = {("S175", name): each for name, each in SEAS.items()}
    made[("rolls at 13 s", "ss3")] = ROLLING
    return {key: each for key, each in made.items() if key[0] in hulls}


def variants(hull: str) -> tuple[tuple[float, ...], bool]:
    """Orifices that the other crane has run on a hull, and whether feedback alone."""
    return (FACTORS, True) if hull == "S175" else (OTHERS, False)


def same_rows(crane: Crane, hulls: Mapping[str, Hull | TransferFunctions]) -> Iterator[str]:
    """The other crane's own four seaways."""
    yield f"\n### The other crane's four seaways, γ = {PEAK}: this / other\n"
    rows: dict[str, dict[str, str]] = {}
    for (hull, name), others in studied(hulls).items():
        sea = Seaway(peaked(name), ship=hulls[hull])
        found = measured(crane, sea, range(4), *variants(hull))
        for (variant, values), other in zip(found.items(), others, strict=True):
            rows.setdefault(variant, {})[f"{hull}, {name}"] = f"{values.mean():.2f} / {other:g}"
    heads = [f"{hull}, {name}" for hull, name in studied(hulls)]
    yield f"| variant | {' | '.join(heads)} |\n|---|{'--:|' * len(heads)}"
    for variant, cells in rows.items():
        yield f"| {variant} | {' | '.join(cells.get(each, '') for each in heads)} |"


def none_rows(
    crane: Crane,
    count: int,
    hulls: Mapping[str, Hull | TransferFunctions],
) -> Iterator[str]:
    """No control in many seaways of the other crane's peak, on ideal drives, which hold as well."""
    random = np.random.default_rng(0)  # its own, so that the tables behind it draw what they did
    yield f"\n### No control, γ = {PEAK}, {count} seaways\n"
    yield "| hull | sea | mean (95 %) | 95 % of means of 4 | other crane, 4 seaways |"
    yield "|---|---|--:|--:|--:|"
    for (hull, name), others in studied(hulls).items():
        sea = Seaway(peaked(name), ship=hulls[hull])
        found = judge(
            crane, {"none": None}, sea=sea, seeds=range(count), drives=["ideal"], length=LENGTH,
            start=START, executor=Threads(2),
        )  # fmt: skip
        values = np.degrees(found.counted("none, ideal"))
        fours = np.sort(values[random.integers(0, values.size, (20_000, 4))].mean(axis=1))
        yield (
            f"| {hull} | {name} | {interval(mean_of(values), '.2f')} | {fours[500]:.2f} to "
            f"{fours[19_499]:.2f} | {others[0]:g} |"
        )


def peaked(name: str) -> Spectrum:
    """A sea state with the other crane's peak."""
    return replace(SEA_STATES[name], peak_factor=PEAK)


def motion_rows(hulls: Mapping[str, Hull | TransferFunctions]) -> Iterator[str]:
    """Significant amplitudes of sway, heave and roll in beam seas, by integration."""
    yield "\n### Motions abeam, significant single amplitudes: this / other\n"
    yield "| hull | sea | γ | sway [m] | heave [m] | roll [deg] |\n|---|---|--:|--:|--:|--:|"
    omega = np.linspace(0.25, 2.5, 2001)
    for (hull, name), others in MOTIONS.items():
        for sea in (SEA_STATES[name], peaked(name)) if hull in hulls else ():
            response = hulls[hull].response(omega, np.full(omega.size, 0.5 * np.pi))[1:4]
            power = np.trapezoid(np.abs(response) ** 2 * sea.density(omega), omega)
            sizes = 2.0 * np.sqrt(power) * (1.0, 1.0, np.degrees(1.0))
            cells = [
                f"{size:.3f} / {'–' if other is None else format(other, 'g')}"
                for size, other in zip(sizes, others, strict=True)
            ]
            yield f"| {hull} | {name} | {sea.peak_factor:g} | {' | '.join(cells)} |"


# --- residual swing -------------------------------------------------------------------------------

SLEWS = {  # residual swing [deg]: ideal drives, volts, inverse maps
    0.1: (0.831, 2.17, 0.842),
    0.2: (1.258, 4.44, 1.243),
    0.5: (7.03, 10.23, 6.95),
    0.8: (12.51, 14.89, 12.38),
    1.0: (7.88, 8.95, 7.75),
}
PATHS = {  # ideal tip ZV, drives tip ZV and ZVD with a position loop of 1 /s [deg]
    0.2: (0.0001, 0.051, 0.070),
    0.5: (0.0031, 0.169, 0.087),
    0.8: (0.0171, 0.097, 0.182),
    1.0: (0.0327, 1.144, 0.368),
}
TIP = control.TipShaper("zv")
PLAIN: tuple[tuple[Actuation, Control | None], ...] = (
    ("ideal", None),
    ("volts", None),
    ("inverse", None),
)
TIPS: tuple[tuple[Actuation, Control | None], ...] = (
    ("ideal", TIP),
    ("inverse", TIP | control.PositionLoop(1.0)),
    ("inverse", control.TipShaper("zvd") | control.PositionLoop(1.0)),
)


def slew_tables(crane: Crane) -> Iterator[str]:
    """Residual swing after a slew of 45 degrees."""
    for title, heads, variants, others in (
        (
            "Slew of 45°, rope 20 m, boom 45°: residual swing, this crane / other [deg]",
            "ideal | volts | inverse",
            PLAIN,
            SLEWS,
        ),
        (
            "The same slew, path of the tip shaped [deg]",
            "ideal, tip ZV | drives, tip ZV | drives, tip ZVD",
            TIPS,
            PATHS,
        ),
    ):
        yield f"\n### {title}\n\n| stick | {heads} |\n|--:|{'--:|' * len(variants)}"
        for part, numbers in others.items():
            stick = Stick.trapezoid(slew=part, until={"slew_deg": 45.0}, length=160.0)
            cells = []
            for (actuation, law), other in zip(variants, numbers, strict=True):
                run = simulate(
                    crane, stick, control=law, actuation=actuation, swing_damping=UNDAMPED
                )
                cells.append(f"{run.residual_deg:.3g} / {other:g}")
            yield f"| {part:g} | {' | '.join(cells)} |"


# actuation, control, the other crane's residual and RMS in a seaway [deg]
MANEUVERS: tuple[tuple[Actuation, str, Control | None, float, float], ...] = (
    ("ideal", "none", None, 9.77, 8.58),
    ("volts", "none", None, 13.78, 12.30),
    ("inverse", "tip ZV", TIP, 0.33, 4.81),
    ("inverse", "tip ZV + feedback", TIP | FEEDBACK, 0.55, 3.48),
    ("ideal", "tip ZV + feedback", TIP | FEEDBACK, 0.43, 2.28),
)


def maneuver_table(crane: Crane, count: int) -> Iterator[str]:
    """Slew, luff and hoist at once, calm and in seaways of the rolling hull."""
    # by 5 m, whatever rope the luff pays out meanwhile
    hoisting = 5.0 / (0.6 * crane.inverse("hoist").limits[1] * crane.geometry.hoist) + 0.5
    stick = Stick.trapezoid(
        slew=0.8, luff=0.8, hoist=0.6, duration=hoisting, length=120.0,
        until={"slew_deg": 90.0, "boom_deg": 52.7},
    )  # fmt: skip
    yield "\n### Slew to 90°, luff from 38° to 52.7°, hoist by 5 m from 28 m"
    yield f"\nIn {count} seaways of ss3 abeam with γ = {PEAK}, RMS from the stick's end on.\n"
    yield (
        "| drives | control | calm, residual | other | slew ends | seaways, RMS (95 %) "
        "| seaways 0 to 3 | other |"
    )
    yield "|---|---|--:|--:|--:|--:|--:|--:|"
    for actuation, name, law, calm, sea in MANEUVERS:
        how: Setup = {
            "control": law,
            "actuation": actuation,
            "boom_deg": 38.0,
            "rope_m": 28.0,
            "swing_damping": UNDAMPED,
        }
        run = simulate(crane, stick, **how)
        swing = [
            simulate(crane, stick, sea=Seaway(peaked("ss3"), seed=seed), **how).rms_deg(
                run.stick_end
            )
            for seed in range(count)
        ]
        yield (
            f"| {actuation} | {name} | {run.residual_deg:.2f} | {calm:g} | {run.slew_deg[-1]:.2f}° "
            f"| {interval(mean_of(np.array(swing)), '.2f')} | {np.mean(swing[:4]):.2f} | {sea:g} |"
        )


def rope_table() -> Iterator[str]:
    """Shapers tuned to a wrong rope, and one that knows the rope, along a straight path."""
    yield "\n### Rope not as the shaper believes, straight path, residual swing to unshaped"
    yield "\n| frequency to the shaper's | ZV | ZVD | EI | ZV, ZVD or EI that know the rope |"
    yield "|--:|--:|--:|--:|--:|"
    for ratio in (0.6, 0.8, 1.0, 1.2, 1.4):
        rope = 20.0 / ratio**2
        plain = _left(rope, None, 20.0)
        fixed = [_left(rope, shape, 20.0) / plain for shape in ("zv", "zvd", "ei")]
        live = [_left(rope, shape, rope) / plain for shape in ("zv", "zvd", "ei")]
        yield (
            f"| {ratio:.0%} | {' | '.join(f'{each:.1%}' for each in fixed)} | "
            f"{', '.join(f'{each:.1%}' for each in live)} |"
        )


def _left(rope: float, shape: str | None, tuned: float) -> float:
    """Residual swing [rad] of a tip that is moved along a line, shaped for a rope."""
    rate, half = 512.0, np.pi * np.sqrt(tuned / 9.80665)
    time = np.arange(round(90.0 * rate)) / rate
    impulses = control.IMPULSES[shape] if shape else (1.0, 0.0, 0.0)
    tip = np.zeros((time.size, 3))
    for k, share in enumerate(impulses):
        # 0.5 m/s for 3 s with ramps of 0.5 s: small, so that the swing is linear
        begun = np.interp(time - 1.0 - k * half, [0.0, 0.5, 3.0, 3.5], [0.0, 0.5, 0.5, 0.0])
        tip[:, 0] += share * np.cumsum(begun) / rate
    load = load_motion(tip, np.full(time.size, rope), rate).position
    late = time > 1.0 + 3.5 + 2.0 * half + 0.1
    return float(np.abs(load[late, 0] - tip[late, 0]).max() / rope)


# --- page -----------------------------------------------------------------------------------------

BEGIN, END = "<!-- tables: begin -->", "<!-- tables: end -->"


def main() -> None:
    """Compute all tables, print them, and on request put them into the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--write", action="store_true", help=f"update {PAGE.name}")
    arguments = parser.parse_args()
    crane = Crane.preset("tg3637")
    lines = [
        *slew_tables(crane),
        *maneuver_table(crane, min(arguments.seeds, 40)),
        *rope_table(),
        *seaway_tables(crane, arguments.seeds),
    ]
    print("\n".join(lines))
    if arguments.write:
        before, rest = PAGE.read_text("utf-8").split(BEGIN)
        after = rest.split(END)[1]
        PAGE.write_text(before + BEGIN + "\n".join(["", *lines, ""]) + END + after, "utf-8")


if __name__ == "__main__":
    main()
