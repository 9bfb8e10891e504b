"""Three functions, and what they call, as they read in C: golden.c is reviewed when it changes."""

from pathlib import Path

from swashplate.equations.c_source import Unit
from swashplate.models import channel, displacement_control

GOLDEN = Path(__file__).parent / "golden.c"


def test_three_functions_read_as_they_were_reviewed() -> None:
    unit = Unit("swp_")
    for equation in (
        channel.limited_current,
        displacement_control.pressure_limits,
        displacement_control.solenoid_force,
    ):
        unit.add(equation)
    made = "\n\n".join([*unit.helpers(), *unit.texts])
    assert f"{made}\n" == GOLDEN.read_text("utf-8")
