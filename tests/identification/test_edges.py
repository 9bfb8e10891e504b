"""Jumps of a command between two samples, whose instants a fit of a drive estimates."""

from dataclasses import replace

import numpy as np
import pytest
from tests.identification.given import TWO_STAGES, run_of

from swashplate import Campaign, Drive, Experiment
from swashplate.campaign.experiment import InputSignal
from swashplate.identification import fit, predict


def command(rate: float, *levels: float, hold: str = "linear", noise: float = 0.0) -> InputSignal:
    """A second at each level, with samples in the middle of each interval."""
    time = (np.arange(round(len(levels) * rate)) + 0.5) / rate
    values = np.asarray(levels)[time.astype(int)]
    values = values + noise * np.random.default_rng(1).normal(size=time.size)
    return run_of("run", values, {}, time=time, hold=hold).input


@pytest.mark.parametrize(
    ("signal", "instants"),
    [
        (command(100.0, 0.0, 4.0, -2.0, noise=0.01), [1.0, 2.0]),
        (command(100.0, 0.0, 4.0, hold="previous"), []),
        (command(512.0, 0.0, 4.0), []),  # as it is logged
        (command(100.0, 0.0, 4.0, 4.2), [1.0]),  # small beside the range
        (run_of("ramp", np.linspace(0.0, 9.0, 10), {}, time=np.arange(10) / 10.0).input, []),
    ],
)
def test_jumps_between_two_samples(signal: InputSignal, instants: list[float]) -> None:
    assert [each.middle for each in signal.edges] == pytest.approx(instants)


def thinned(run: Experiment, first: int) -> Experiment:
    """Every fifth sample of a run."""
    kept, names = slice(first, None, 5), ("time", "values", "weight", "counts")
    channels = {}
    for name, each in run.channels.items():
        rows = {part: getattr(each, part) for part in names}
        left = {part: row[kept] for part, row in rows.items() if row is not None}
        channels[name] = replace(each, **left)
    signal = replace(run.input, time=run.input.time[kept], values=run.input.values[kept])
    return replace(run, input=signal, channels=channels)


def test_a_slow_log_of_steps_is_fitted_as_well_as_a_fast_one(short_campaign: Campaign) -> None:
    """At 102 Hz; without the instants Z10 would be 0.07 % off, and J 0.1 %."""
    runs = [thinned(each, k) for k, each in enumerate(short_campaign.select(role="fit"))]
    found = fit(Drive.preset("hoist"), runs, TWO_STAGES)
    numbers = found.drive.parameters.numbers
    assert numbers["J_plus"] == pytest.approx(0.26, rel=2e-5)
    assert numbers["J_minus"] == pytest.approx(0.31, rel=2e-5)
    assert numbers["Z10"] == pytest.approx(13.0, rel=1e-4)
    assert "Commands jump 8 times between two samples: when is estimated." in found.sentences
    card, pump = found.stages
    instants = []
    for run in runs:
        own = {k: v for k, v in pump.values.items() if run.name in k}
        for edge in run.input.edges:
            name = f"edge at {edge.middle:.6g} s ({run.name})"
            assert card.values[name] == pytest.approx(own[name], abs=1e-4)
            instants.append(edge.middle + own[name])
    # all at 0.5 s and 2.5 s of the commands, and all with the same rounding off
    assert np.diff(np.reshape(instants, (-1, 2)), axis=0) == pytest.approx(0.0, abs=3e-4)


@pytest.mark.parametrize("first", [0, 2])
def test_a_slow_log_is_predicted_as_well_as_a_fast_one(
    short_campaign: Campaign, first: int
) -> None:
    """By the true drive, of which these logs have no noise; with jumps halfway it is far off."""
    truth = Drive.preset("hoist").replace(J=(0.26, 0.31), Z10=13.0)
    for run in short_campaign.experiments:
        found = {each.channel: each for each in predict(truth, [thinned(run, first)])}
        rounding = run["counts"].resolution / np.sqrt(12.0)
        assert found["counts"].measures.rmse < 0.2 * rounding
        assert found["current"].measures.rmse < 4e-4
