from dataclasses import replace

import numpy as np
import pytest

from swashplate import Drive, InputError, maneuvers
from swashplate.campaign import rig

STEP = maneuvers.step(4.0)
SINE = maneuvers.sine(4.0, 0.2, length=12.0)


def same(one: rig.VirtualRun, other: rig.VirtualRun) -> bool:
    return one.columns.keys() == other.columns.keys() and all(
        np.array_equal(values, other.columns[name], equal_nan=True)
        for name, values in one.columns.items()
    )


def split(drive: Drive) -> Drive:
    """The drive as the rig simulates it: its decay takes over within a step."""
    return Drive(replace(drive.parameters, card_switch="split"))


def test_clean_logs_are_the_model_to_the_last_bit() -> None:
    tests = rig.run("hoist", severity="clean")
    assert list(tests.runs) == list(maneuvers.source_tests("hoist"))
    assert sum(run.columns["time"].size for run in tests.runs.values()) == 110_605
    drive = split(Drive.preset("hoist"))
    for name, maneuver in maneuvers.source_tests("hoist").items():
        columns = tests.runs[name].columns
        model = drive.simulate(maneuver.sample())
        np.testing.assert_array_equal(columns["time"], np.arange(model.time.size) / 512.0)
        np.testing.assert_array_equal(columns["voltage"], model.voltage)
        np.testing.assert_array_equal(
            columns["current"], model.current_positive + model.current_negative
        )
        np.testing.assert_allclose(
            columns["counts"],
            model.shaft_position / (2.0 * np.pi) * 2526.315789473684,
            rtol=1e-14,
        )


def test_a_realistic_log_leaves_noise_of_mean_zero_alone() -> None:
    """A fit drives the model by the voltage that was logged: that alone must give the truth."""
    tools = replace(rig.SEVERITIES["realistic"], lost_rows=0.0)
    tests = rig.run("hoist", instruments=tools)
    residuals = []
    for run in tests.runs.values():
        columns = run.columns
        model = tests.drive.simulate(
            columns["voltage"], time=columns["time"], interpolation="linear"
        )
        current = model.current_positive + model.current_negative
        truth = run.truth.current_positive + run.truth.current_negative
        wrong = np.interp(run.truth.time, model.time, current) - truth
        # one code too much or too little is 4.9 mV, at 0.06 A/V 0.3 mA; beside the dead zone it
        # moves the jump of 0.27 A by a part of a sample, which the card's filter flattens
        assert np.abs(wrong).max() < 4e-3
        assert np.sqrt(np.mean(wrong**2)) < 1e-4
        # whole periods of the dither: 128 samples are 25
        whole = columns["current"].size // 128 * 128
        reading = columns["current"] - np.interp(columns["time"], model.time, current)
        residuals.append(reading[:whole])
        counts = model.shaft_position * tests.counts_per_turn / (2.0 * np.pi)
        assert (
            np.abs(np.interp(columns["time"], model.time, counts) - columns["counts"]).max() < 1.3
        )
    together = np.concatenate(residuals)
    # 2 mA of noise, converter steps of 0.5 mA and a ripple of up to 15 mA
    assert 0.002 < together.std() < 0.015
    assert abs(together.mean()) < 4.0 * 0.002 / np.sqrt(together.size)


def test_the_same_seed_gives_the_same_logs_in_any_order_and_company() -> None:
    alone = rig.run("hoist", [STEP], seed=5, severity="harsh")
    last = rig.run("hoist", [SINE, STEP], seed=5, severity="harsh")
    first = rig.run("hoist", [STEP, SINE], seed=5, severity="harsh")
    assert same(alone.runs[STEP.name], last.runs[STEP.name])
    assert same(first.runs[SINE.name], last.runs[SINE.name])
    other = rig.run("hoist", [STEP], seed=6, severity="harsh")
    assert not same(alone.runs[STEP.name], other.runs[STEP.name])


def test_other_channels_are_the_simulated_signals() -> None:
    kinds = (
        "signed_current",
        "current_plus",
        "current_minus",
        "shaft_speed",
        "position",
        "stroker_pressure",
        "swash_angle",
        "spool_position",
    )
    run = rig.run("luff", [SINE], severity="clean", channels=kinds).runs[SINE.name]
    model = split(Drive.preset("luff")).simulate(SINE.sample())
    assert list(run.columns) == ["time", "voltage", *kinds]
    for column, signal in (
        ("signed_current", model.current),
        ("current_minus", model.current_negative),
        ("shaft_speed", model.shaft_speed),
        ("position", model.shaft_position),
        ("stroker_pressure", model.stroker_pressure),
        ("swash_angle", model.swash_angle),
        ("spool_position", model.spool_position),
    ):
        np.testing.assert_array_equal(run.columns[column], signal)
    noisy = rig.run("luff", [SINE], channels=["swash_angle"]).runs[SINE.name].columns["swash_angle"]
    assert 0.0 < np.abs(np.diff(noisy[:500])).mean() < 0.02 * np.abs(noisy).max()


def test_backlash_is_between_shaft_and_encoder() -> None:
    loose = replace(rig.SEVERITIES["clean"], backlash=0.01)
    kinds = ("position", "shaft_speed", "encoder_counts")
    tests = rig.run("hoist", [SINE], instruments=loose, channels=kinds)
    run = tests.runs[SINE.name]
    np.testing.assert_array_equal(run.columns["shaft_speed"], run.truth.shaft_speed)
    lag = run.truth.shaft_position - run.columns["position"]
    assert lag.max() == pytest.approx(0.005, rel=1e-9)
    assert lag.min() == pytest.approx(-0.005, rel=1e-9)
    counts = run.columns["position"] * tests.counts_per_turn / (2.0 * np.pi)
    np.testing.assert_allclose(run.columns["counts"], counts, rtol=1e-14)


def test_perturbed_values_stay_within_the_spread() -> None:
    hoist = Drive.preset("hoist")
    numbers = hoist.parameters.numbers
    logarithms = []
    for seed in range(10):
        tests = rig.run("hoist", [STEP], perturb=0.1, seed=seed, channels=["shaft_speed"])
        drawn = tests.drive.parameters.numbers
        for column, value in numbers.items():
            if value == 0.0 or not np.isfinite(value) or column == "Z14":
                assert drawn[column] == value
            else:
                logarithms.append(np.log(drawn[column] / value))
    spread = np.array(logarithms)
    assert np.abs(spread).max() <= 0.1 + 1e-12
    # a normal of half the spread, cut at twice its own: 0.88 of it is left
    assert spread.std() == pytest.approx(0.05 * 0.8796, rel=0.1)
    assert tests.drive.name == "hoist"
    assert tests.nominal == hoist


def test_tests_of_middle_size_are_kept_for_validation() -> None:
    roles = {name: run.role for name, run in rig.run("hoist").runs.items()}
    kept = {name for name, role in roles.items() if role == "validate"}
    assert kept == {"step +6.5 V", "step -6.5 V", "sine 6.5 V 0.1 Hz"}
    assert {run.role for run in rig.run("hoist", [STEP, SINE]).runs.values()} == {"fit"}
    own = rig.run("hoist", [STEP, SINE], validate=[SINE.name])
    assert [run.role for run in own.runs.values()] == ["fit", "validate"]


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"severity": "awful"}, "severity is 'awful'; it is one of clean, realistic, harsh."),
        ({"seed": -1}, "seed must be a whole number from 0 up, not -1."),
        ({"maneuvers": []}, "A campaign needs at least one maneuver."),
        ({"maneuvers": [STEP, STEP]}, "Two maneuvers have the same name"),
        ({"maneuvers": {"a b": STEP, "a/b": STEP, "a_b": SINE}}, "would have the same file"),
        ({"channels": ("counts",)}, "There is no channel 'counts'; there are signed_current"),
        ({"channels": ()}, "channels must be one or more kinds, each once."),
        ({"validate": ["step 4 V"]}, "There is no run 'step 4 V' to validate"),
        ({"perturb": 0.9}, "perturb must be above 0 and at most 0.5, not 0.9."),
        ({"axis": "boom", "maneuvers": [STEP]}, "The encoder of 'boom' is not known"),
        ({"maneuvers": [20.0 * STEP]}, "±10 V"),
    ],
)
def test_what_cannot_be_run_is_refused(options: dict, sentence: str) -> None:
    with pytest.raises(InputError) as error:
        rig.run("hoist", **options)
    assert sentence in str(error.value)
