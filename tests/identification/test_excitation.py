"""Which run tells of which unknown."""

import numpy as np

from swashplate.identification.excitation import excitation
from swashplate.identification.linearised import LinearisedFit, LinearisedRun
from swashplate.identification.variables import Variables


def test_shares_by_hand() -> None:
    first = np.array([[3.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    second = np.array([[1.0, 0.0, 0.0]])
    runs = [
        LinearisedRun("ramp", "speed", np.arange(2.0), np.zeros(2), first),
        LinearisedRun("step", "speed", np.arange(1.0), np.zeros(1), second),
    ]
    found = excitation(LinearisedFit.of(runs, Variables.of(["Z8", "Z13", "Z14"], np.ones(3))))
    np.testing.assert_allclose(found.share, [[0.9, 1.0, 0.0], [0.1, 0.0, 0.0]])
    np.testing.assert_allclose(found.sensitivity[0], [0.03 / np.sqrt(2.0), 0.01 / np.sqrt(2.0), 0])
    assert found.sentences() == (
        "Z8: 90 % of what is known of it comes from ramp, speed alone.",
        "Z13: 100 % of what is known of it comes from ramp, speed alone.",
        "Z14: no run depends on it.",
    )
