"""A crane that follows its command in open loop, and the same inputs for its machine."""

from swashplate.crane import AXES, OperatorCommand

SHIP = ("surge", "sway", "heave", "roll", "pitch", "yaw")
SIGNALS = [f"{point}_{axis}" for point in ("tip", "load", "hook") for axis in "xyz"]
SIGNALS += [f"shaft_{axis}" for axis in AXES] + ["pull", "rope", "boom_cos", "boom_sin"]


def command(length=10.0):
    return OperatorCommand.trapezoid(
        hoist=-0.2, slew=1.0, luff=0.3, duration=0.5 * length, length=length
    )


def inputs_of(run):
    """What a run's drives and body took, by the machine's names."""
    inputs = {f"{axis}.voltage": run[f"voltage_{axis}"] for axis in AXES}
    moving = run.ship.shape[1] > 1
    return inputs | {
        f"body.{name}": run.ship[:, column] if moving else 0.0 for column, name in enumerate(SHIP)
    }
