"""Kruse's largest per cent errors."""

from dataclasses import replace

import numpy as np
import pytest
from reproduction.source_errors import (
    SOURCE_RULES,
    ComparedRun,
    ErrorTable,
    error_table,
    error_tables,
    source_rules,
)
from tests.identification.given import run_of

from swashplate.identification.validation import compared

FINE = np.arange(0.0, 10.0, 0.01)
TIME = np.arange(0.0, 10.0, 0.1)


def step(**more: object) -> ComparedRun:
    """Command on from 1 s to 6 s; the simulation is 2 % high, and 30 % off where it rises."""
    command = np.where((TIME >= 1.0) & (TIME < 6.0), 4.0, 0.0)
    measured = np.where((TIME >= 1.0) & (TIME < 7.0), 100.0, 0.0)
    simulated = 1.02 * measured
    simulated[(TIME > 1.05) & (TIME < 1.95)] = 130.0
    fields = {
        "name": "hoistr6", "kind": "step", "quantity": "shaft_speed", "time": TIME,
        "command": command, "measured": measured, "simulated": simulated,
    }  # fmt: skip
    return ComparedRun(**{**fields, **more})


def sine(frequency: float = 0.1, quantity: str = "shaft_speed", **more: object) -> ComparedRun:
    turn = 2.0 * np.pi * frequency * TIME
    fields = {
        "name": f"sine {frequency:g} Hz", "kind": "sine", "quantity": quantity, "time": TIME,
        "command": 4.0 * np.sin(turn), "measured": 50.0 * np.sin(turn),
        "simulated": 55.0 * np.sin(turn), "frequency": frequency,
    }  # fmt: skip
    return ComparedRun(**{**fields, **more})


def percent(table: ErrorTable) -> dict[str, float | None]:
    return {row.kind: row.percent for row in table.rows}


def test_the_settled_error_of_a_step() -> None:
    table = error_table("speed", [step()])
    assert percent(table) == {"step": pytest.approx(2.0)}
    (row,) = table.rows
    assert row.run == "hoistr6"
    assert row.time >= 3.0
    assert row.runs == 1


def test_fast_sines_are_left_out_as_a_whole() -> None:
    table = error_table("speed", [sine(0.1), sine(0.3, simulated=np.zeros(TIME.size))])
    assert percent(table)["sine"] == pytest.approx(10.0)
    assert table.left_out == (("sine 0.3 Hz", "fast sines"),)
    alone = error_table("speed", [sine(0.3)])
    assert [rule.name for rule in alone.acted] == ["fast sines"]


def test_dither_is_averaged_over() -> None:
    dither = 20.0 * np.where(np.arange(TIME.size) % 2, 1.0, -1.0)
    run = step(simulated=1.02 * step().measured + dither)
    assert percent(error_table("speed", [run]))["step"] > 20.0
    assert percent(error_table("speed", [run], average=0.2))["step"] == pytest.approx(2.0, abs=0.01)


def test_the_table_of_a_channel() -> None:
    current = np.where((FINE >= 1.0) & (FINE < 6.0), 0.5, 0.0)
    # 5 % too large throughout, 40 % within the overshoot's window that is left out
    simulated = current * np.where((FINE >= 1.0) & (FINE < 2.0), 1.4, 1.05)
    command, channels = (
        np.where((FINE >= 1.0) & (FINE < 6.0), 4.0, 0.0),
        {"rectified_current": current},
    )
    more = {"time": FINE, "hold": "previous", "role": "validate"}
    step = run_of("a", command, channels, maneuver="step +4 V", **more)
    free = run_of("b", command, channels, maneuver="free", **more)
    (found,) = error_tables(
        [
            compared(step, "rectified_current", simulated),
            compared(free, "rectified_current", current),
        ]
    )
    assert (found.channel, found.unjudged, found.average) == ("rectified_current", ("b",), 0.1)
    (row,) = found.rows
    assert (row.kind, row.run) == ("step", "a")
    assert row.percent == pytest.approx(5.0, rel=1e-6)
    assert [each.name for each in source_rules("slew")] == [
        *(each.name for each in source_rules("hoist")),
        "steps",
    ]
    (slew,) = error_tables([compared(step, "rectified_current", simulated)], source_rules("slew"))
    assert slew.rows[0].percent is None


PULSE = np.where((TIME >= 1.0) & (TIME < 6.0), 1.0, 0.0)
EDGES = ((TIME > 0.95) & (TIME < 2.95)) | ((TIME > 5.95) & (TIME < 7.95))
NONE, ALL = np.zeros(TIME.size, dtype=bool), np.ones(TIME.size, dtype=bool)
LATE = 30.0 * PULSE + 70.0 * PULSE * (TIME > 3.0)


@pytest.mark.parametrize(
    ("name", "run", "out"),
    [
        ("start transient", step(), TIME < 400.0 / 512.0),
        ("start transient", step(quantity="rectified_current"), NONE),
        ("overshoot", step(), EDGES),
        ("overshoot", step(kind="ramp"), NONE),
        (
            "zero crossings",
            sine(quantity="rectified_current"),
            np.abs(np.sin(0.2 * np.pi * TIME)) < 0.1,
        ),
        ("zero crossings", sine(), NONE),
        ("zero crossings", step(quantity="rectified_current"), NONE),
        ("fast sines", sine(0.3), ALL),
        ("fast sines", sine(0.1), NONE),
        ("fast sines", replace(sine(), frequency=None), NONE),
        ("small values", step(measured=LATE), PULSE == 0.0),
    ],
)
def test_samples_that_a_rule_leaves_out(name: str, run: ComparedRun, out: np.ndarray) -> None:
    (rule,) = (each for each in SOURCE_RULES if each.name == name)
    found = np.broadcast_to(rule.excluded(run), run.time.shape)
    np.testing.assert_array_equal(found, out)
