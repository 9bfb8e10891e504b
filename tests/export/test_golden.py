"""Three functions as they read in C: golden.c is looked at by people, and changes with reason."""

from pathlib import Path

from swashplate.equations.c_source import Unit
from swashplate.models import card, displacement_control

GOLDEN = Path(__file__).parent / "golden.c"


def test_three_functions_read_as_they_were_reviewed() -> None:
    unit = Unit("swp_")
    for equation in (
        card.limited_current,
        displacement_control.pressure_limits,
        displacement_control.solenoid_force,
    ):
        unit.add(equation)
    structs = [text for _, text in unit.structs.values()]
    constants = [text for _, text in unit.constants.values()]
    made = "\n\n".join([*unit.helpers(), *structs, *constants, *unit.texts]) + "\n"
    assert made == GOLDEN.read_text("utf-8")
