"""The source's largest per cent errors, with its exclusions."""

import numpy as np
import pytest

from swashplate.errors import InputError
from swashplate.identification.error_tables import (
    SOURCE_RULES,
    ComparedRun,
    ErrorTable,
    WholeKind,
    error_table,
    sine_error,
)

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
    return ComparedRun(**{**fields, **more})  # type: ignore[arg-type]


def sine(frequency: float = 0.1, quantity: str = "shaft_speed", **more: object) -> ComparedRun:
    turn = 2.0 * np.pi * frequency * TIME
    fields = {
        "name": f"sine {frequency:g} Hz", "kind": "sine", "quantity": quantity, "time": TIME,
        "command": 4.0 * np.sin(turn), "measured": 50.0 * np.sin(turn),
        "simulated": 55.0 * np.sin(turn), "frequency": frequency,
    }  # fmt: skip
    return ComparedRun(**{**fields, **more})  # type: ignore[arg-type]


def percent(table: ErrorTable) -> dict[str, float | None]:
    return {row.kind: row.percent for row in table.rows}


def test_the_settled_error_of_a_step() -> None:
    table = error_table([step()])
    assert percent(table) == {"step": pytest.approx(2.0)}
    (row,) = table.rows
    assert row.run == "hoistr6"
    assert row.time >= 3.0
    assert row.runs == 1


def test_the_overshoot_counts_if_its_rule_is_off() -> None:
    rules = [rule for rule in SOURCE_RULES if rule.name != "overshoot"]
    assert percent(error_table([step()], rules=rules))["step"] == pytest.approx(30.0)


def test_rules_that_left_out_something_are_printed() -> None:
    """A step's speed has no zero crossings of a current, and there is no fast sine."""
    table = error_table([step()])
    said = table.sentences()
    assert [rule.name for rule in table.rules] == [rule.name for rule in SOURCE_RULES]
    assert [rule.name for rule in table.acted] == ["start transient", "overshoot", "small values"]
    assert sum(each.startswith("Left out (") for each in said) == 3
    assert any("plussing" in each for each in said)
    assert any("Per cent of what is measured then." in each for each in said)
    assert "step: 2.00 % in hoistr6 at" in said[0]


def test_per_cent_of_the_largest_value() -> None:
    run = sine(simulated=sine().measured + 5.0)
    rules = [rule for rule in SOURCE_RULES if rule.name != "small values"]
    # 5 of the largest measured value, 50 sin(0.2π·2.5) = 50
    assert percent(error_table([run], rules=rules, reference="largest"))["sine"] == pytest.approx(
        10.0
    )
    # of what is measured it is largest where that is smallest: 20 % of 50
    found = percent(error_table([run]))["sine"]
    assert found == pytest.approx(100.0 * 5.0 / (50.0 * np.sin(0.2 * np.pi * 0.4)), rel=1e-6)


def test_fast_sines_are_left_out_as_a_whole() -> None:
    table = error_table([sine(0.1), sine(0.3, simulated=np.zeros(TIME.size))])
    assert percent(table)["sine"] == pytest.approx(10.0)
    assert table.left_out == (("sine 0.3 Hz", "fast sines"),)
    alone = error_table([sine(0.3)])
    assert [rule.name for rule in alone.acted] == ["fast sines"]


def test_nothing_left_is_a_verdict() -> None:
    table = error_table([sine(0.3)])
    assert percent(table) == {"sine": None}
    assert table.sentences()[0] == "sine: no sample is left to judge."


def test_slew_leaves_out_its_steps() -> None:
    table = error_table([step()], rules=[*SOURCE_RULES, WholeKind("step")])
    assert percent(table) == {"step": None}
    assert any("backlash" in each for each in table.sentences())


def test_a_run_at_rest_has_no_per_cent() -> None:
    still = step(measured=np.zeros(TIME.size))
    assert percent(error_table([still], rules=[])) == {"step": None}


def test_rows_come_in_the_sources_order() -> None:
    ramp = step(kind="ramp", name="ramp")
    assert [row.kind for row in error_table([sine(), step(), ramp]).rows] == [
        "ramp",
        "step",
        "sine",
    ]


def test_dither_is_averaged_over() -> None:
    dither = 20.0 * np.where(np.arange(TIME.size) % 2, 1.0, -1.0)
    run = step(simulated=1.02 * step().measured + dither)
    assert percent(error_table([run]))["step"] > 20.0
    assert percent(error_table([run], average=0.2))["step"] == pytest.approx(2.0, abs=0.01)


def test_a_sine_by_amplitude_and_phase() -> None:
    """The 2.90 % of the source: what the shape at the peaks does not enter."""
    late = sine(simulated=51.45 * np.sin(0.2 * np.pi * TIME - 0.05))
    found = sine_error(late, rules=[])
    assert found.amplitude_percent == pytest.approx(2.9)
    assert found.phase == pytest.approx(-0.05)


@pytest.mark.parametrize(
    ("run", "said"),
    [
        (step(), "no sine of known frequency"),
        (sine(quantity="rectified_current"), "rectified current is no sine"),
        (sine(0.01), "less than one period"),
        (sine(measured=np.zeros(TIME.size)), "nothing was measured"),
    ],
)
def test_what_is_no_sine_is_refused(run: ComparedRun, said: str) -> None:
    with pytest.raises(InputError, match=said):
        sine_error(run, rules=[])


@pytest.mark.parametrize(
    ("runs", "more", "said"),
    [
        ([], {}, "at least one run"),
        ([step(measured=np.zeros(3))], {}, "differ in length"),
        ([step(simulated=np.full(TIME.size, np.nan))], {}, "not finite"),
        ([step()], {"average": -1.0}, "must not be negative"),
    ],
)
def test_wrong_runs_are_refused(runs: list, more: dict, said: str) -> None:
    with pytest.raises(InputError, match=said):
        error_table(runs, **more)
