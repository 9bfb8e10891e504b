"""``swashplate linearize``: the linear model of small motions at an operating point."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from swashplate.cli.arguments import DriveWord, Factors, Values
from swashplate.cli.inputs import changes_said, drive_of, title_of
from swashplate.cli.outputs import check_outputs
from swashplate.cli.terminal import note, show, table, working
from swashplate.errors import DomainError, InputError

if TYPE_CHECKING:
    from rich.table import Table

    from swashplate.linear import LinearDrive

Input = Literal["voltage", "current", "solenoid_force"]
Coulomb = Literal["ignored", "tangent"]
Interpolation = Literal["linear", "previous"]

EXAMPLES = """\
Examples:
  swashplate linearize hoist --at 4
  swashplate linearize hoist --speed-deg-s -50 --loop-gain 0.1
  swashplate linearize slew --at 2 --sample-time 0.01 --out slew.toml
  swashplate linearize luff --current 0 --input solenoid_force
"""


def linearize(
    drive: DriveWord,
    at: Annotated[
        float | None,
        typer.Option(help="Linearise at this constant voltage.", metavar="V", show_default=False),
    ] = None,
    current: Annotated[
        float | None,
        typer.Option(help="Or at this constant signed current.", metavar="A", show_default=False),
    ] = None,
    speed_deg_s: Annotated[
        float | None,
        typer.Option(
            "--speed-deg-s",
            help="Or at the voltage that settles at this speed.",
            metavar="DEG/S",
            show_default=False,
        ),
    ] = None,
    input: Annotated[
        Input | None,
        typer.Option(
            help="What moves the model; by default the voltage, or the current with --current.",
            show_default=False,
        ),
    ] = None,
    coulomb: Annotated[
        Coulomb,
        typer.Option(
            help="The card's Coulomb term: left out, or with its slope at rest, which only motions "
            "below 0.01 A/s see."
        ),
    ] = "ignored",
    sample_time: Annotated[
        float | None,
        typer.Option(
            help="Sample the model, with the recurrences of the simulation.",
            metavar="S",
            show_default=False,
        ),
    ] = None,
    interpolation: Annotated[
        Interpolation,
        typer.Option(help="The input between samples: a straight line, or held."),
    ] = "linear",
    loop_gain: Annotated[
        float | None,
        typer.Option(
            help="Print the margins of a proportional speed loop of this gain.",
            metavar="V/(DEG/S)",
            show_default=False,
        ),
    ] = None,
    frequency: Annotated[
        float, typer.Option(help="Frequency to print gain and phase at.", metavar="HZ")
    ] = 0.3,
    out: Annotated[
        Path | None,
        typer.Option(help="Write the model, in SI, to a .toml or .json file.", metavar="FILE"),
    ] = None,
    values: Values = None,
    factors: Factors = None,
) -> None:
    """Linearise a drive at a voltage, a current or a speed.

    Prints the operating point, the gain, the lag of the pump, the poles, the
    bandwidth and what a speed loop closed over the drive can bear. The model is
    exact for small motions; 'swashplate bode' shows what becomes of large ones.
    """
    import numpy as np

    from swashplate.linear import LINEAR_MODEL, DeadZoneError

    check_outputs((out, LINEAR_MODEL))
    if sum(each is not None for each in (at, current, speed_deg_s)) != 1:
        raise InputError(
            "A drive is linearised at a voltage, a current or a speed: give one of --at, --current "
            "and --speed-deg-s."
        )
    if current is not None and input == "voltage":
        raise InputError("--input voltage needs --at or --speed-deg-s, not --current.")
    with working("Linearising"):
        chosen = drive_of(drive, values or (), factors or ())
        if coulomb == "tangent" and chosen.parameters.coulomb_sign == "literal":
            raise InputError(
                "The literal sign of the card's Coulomb term has no slope; take --coulomb ignored."
            )
        try:
            model = chosen.linearize(
                at,
                current=current,
                speed=None if speed_deg_s is None else float(np.radians(speed_deg_s)),
                input=input,
                coulomb=coulomb,
            )
        except DeadZoneError as error:
            raise DomainError(
                f"{error.where}; {error.instead}, or the pump alone with "
                "--current 0 --input solenoid_force."
            ) from None
        if sample_time is not None:
            model = model.discrete(sample_time, interpolation)
        tables = [_point(model), _motion(model, frequency), _poles(model)]
        if loop_gain is not None:
            tables.append(_loop(model, loop_gain))
    if out is not None:
        model.write(out)
    kind = "" if model.sample_time is None else f", sampled at {model.sample_time:g} s"
    note(f"{title_of(drive, chosen)}, small motions of the {model.input.replace('_', ' ')}{kind}")
    for line in changes_said(drive, chosen):
        note(line)
    for switch in model.operating_point.one_sided:
        note(f"One-sided at the {switch}.")
    if model.input == "voltage" and coulomb == "ignored" and _has_coulomb(model):
        note("The card's Coulomb term C is left out; --coulomb tangent takes it in.")
    show(*tables)
    if out is not None:
        note(f"Model, in SI: {out}")


def _has_coulomb(model: LinearDrive) -> bool:
    voltage = model.operating_point.voltage
    assert voltage is not None
    return model.parameters.numbers["C_plus" if voltage >= 0.0 else "C_minus"] > 0.0


def _point(model: LinearDrive) -> Table:
    from swashplate.cli.measures import degrees

    point = model.operating_point
    made = table(None, "Operating point", ">", "")
    if point.voltage is not None:
        made.add_row("voltage", f"{point.voltage:z.4f}", "V")
    made.add_row("current", f"{point.current:z.4f}", "A")
    made.add_row("swash angle", f"{degrees(point.swash_angle):z.3f}", "deg")
    made.add_row("shaft speed", f"{degrees(point.shaft_speed):z.3f}", "deg/s")
    return made


def _motion(model: LinearDrive, frequency: float) -> Table:
    import numpy as np

    from swashplate.cli.measures import degrees
    from swashplate.linear import UNITS

    unit = UNITS[model.input]
    answer = complex(model.response(frequency)[0])
    made = table(None, "Small motion", ">", "")
    made.add_row("steady gain", f"{degrees(model.gain):z.5g}", f"(deg/s)/{unit}")
    made.add_row("time constant of the pump", f"{model.time_constant:.4f}", "s")
    if model.input == "voltage":
        made.add_row("delay of the card", f"{1e3 * model.parameters.numbers['tau']:.3f}", "ms")
    made.add_row("bandwidth (-3 dB)", _limited(model.bandwidth, ".4g"), "Hz")
    made.add_row(f"gain at {frequency:g} Hz", f"{degrees(abs(answer)):.5g}", f"(deg/s)/{unit}")
    made.add_row(f"phase at {frequency:g} Hz", f"{float(np.angle(answer, deg=True)):z.2f}", "deg")
    largest = np.radians(model.largest_gain)
    made.add_row("largest proportional gain", _limited(largest, ".4g"), f"{unit}/(deg/s)")
    return made


def _poles(model: LinearDrive) -> Table:
    import numpy as np

    continuous = model.sample_time is None
    made = table(None, "Poles", ">real", ">imaginary", ">Hz", ">damping")
    for pole in model.poles:
        if pole.imag < 0.0:
            continue  # its conjugate stands for both
        s = pole if model.sample_time is None else np.log(pole) / model.sample_time
        made.add_row(
            "rad/s" if continuous else "z",
            f"{pole.real:z.5g}",
            f"±{pole.imag:.5g}" if pole.imag else "",
            f"{abs(s) / (2.0 * np.pi):.4g}",
            f"{-s.real / abs(s):.3f}",
        )
    return made


def _loop(model: LinearDrive, loop_gain: float) -> Table:
    import numpy as np

    from swashplate.cli.measures import degrees
    from swashplate.linear import UNITS

    margins = model.margins(degrees(loop_gain))
    made = table(None, f"Proportional loop, {loop_gain:g} {UNITS[model.input]}/(deg/s)", ">", "")
    made.add_row("crossover", f"{margins.crossover:.4g}" if margins.crossover else "none", "Hz")
    made.add_row("phase margin", _limited(float(np.degrees(margins.phase_margin)), ".1f"), "deg")
    made.add_row("delay margin", _limited(1e3 * margins.delay_margin, ".2f"), "ms")
    made.add_row("gain margin", _limited(margins.gain_margin, ".3g"), "")
    return made


def _limited(value: float, spec: str) -> str:
    from math import isinf

    return "no limit" if isinf(value) else format(value, spec)
