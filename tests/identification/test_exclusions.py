"""The rules for what the source leaves out."""

from dataclasses import replace

import numpy as np

from swashplate.identification.error_tables import (
    ComparedRun,
    FastSines,
    Overshoot,
    SmallValues,
    StartTransient,
    ZeroCrossings,
    edges,
)

TIME = np.arange(0.0, 10.0, 0.1)
PULSE = np.where((TIME >= 1.0) & (TIME < 6.0), 1.0, 0.0)


def step(**more: object) -> ComparedRun:
    """On from 1 s to 6 s."""
    made = ComparedRun(
        "step", "step", "shaft_speed", TIME, 4.0 * PULSE, 100.0 * PULSE, 99.0 * PULSE
    )
    return replace(made, **more)  # type: ignore[arg-type]


def sine(frequency: float = 0.1, **more: object) -> ComparedRun:
    wave = np.sin(2.0 * np.pi * frequency * TIME)
    made = ComparedRun(
        "sine", "sine", "shaft_speed", TIME, 4.0 * wave, 50.0 * wave, 55.0 * wave, frequency
    )
    return replace(made, **more)  # type: ignore[arg-type]


def test_the_start_transient_is_the_speeds() -> None:
    early = TIME < 400.0 / 512.0
    rule = StartTransient()
    np.testing.assert_array_equal(rule.excluded(step()), early)
    assert not rule.excluded(step(quantity="rectified_current")).any()


def test_edges_of_a_step_and_of_a_ramp() -> None:
    np.testing.assert_allclose(edges(step()), [1.0, 6.0])
    ramp = step(kind="ramp", command=np.clip(TIME - 1.0, 0.0, None))
    np.testing.assert_allclose(edges(ramp), [1.1])
    assert edges(step(command=np.zeros(TIME.size))).size == 0


def test_overshoot_windows() -> None:
    out = Overshoot(1.0).excluded(step())
    expected = ((TIME > 0.95) & (TIME < 1.95)) | ((TIME > 5.95) & (TIME < 6.95))
    np.testing.assert_array_equal(out, expected)
    ramp = step(kind="ramp")
    assert not Overshoot().excluded(ramp).any()
    assert Overshoot(kinds=("step", "ramp")).excluded(ramp).any()


def test_zero_crossings_are_the_rectified_currents() -> None:
    rule = ZeroCrossings(0.1)
    out = rule.excluded(sine(quantity="rectified_current"))
    np.testing.assert_array_equal(out, np.abs(np.sin(0.2 * np.pi * TIME)) < 0.1 * 1.0)
    assert not rule.excluded(sine()).any()
    assert not rule.excluded(step(quantity="rectified_current")).any()


def test_fast_and_small() -> None:
    assert FastSines().excluded(sine(0.3)).all()
    assert not FastSines().excluded(sine(0.1)).any()
    assert not FastSines().excluded(replace(sine(), frequency=None)).any()
    np.testing.assert_array_equal(SmallValues(0.5).excluded(step()), step().measured < 50.0)
