"""Labels that fit beside their axes."""

import pytest
from swashplate.report.axis_labels import LINES, in_lines


@pytest.mark.parametrize(
    ("label", "letters", "lines"),
    [
        ("voltage (V)", 13, "voltage (V)"),
        ("speed from encoder_counts (deg/s)", 23, "speed from|encoder_counts (deg/s)"),
        ("residual (deg/s)", 14, "residual|(deg/s)"),
        ("encoder_counts, pump (deg)", 14, "encoder_|counts, pump|(deg)"),
        ("speed from the_winch_s_own_encoder (deg/s)", 14, "speed from|the_winch_s…|(deg/s)"),
        ("Trommelwinkelgeschwindigkeit", 23, "Trommelwink…windigkeit"),
    ],
)
def test_labels_are_broken(label: str, letters: int, lines: str) -> None:
    made = in_lines(label, letters)
    assert made.split("\n") == lines.split("|")
    assert made.count("\n") < LINES
    assert max(map(len, made.split("\n"))) <= letters
    # a unit is never lost
    assert made.endswith(label[label.find("(") :]) or "(" not in label
