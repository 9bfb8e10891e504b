"""Campaigns that cannot be fitted get a verdict before the solver; sound ones get none."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.identification.given import run_of, virtual

from swashplate import Campaign, Drive, Experiment, InputError, maneuvers
from swashplate.drafting import guess_drive
from swashplate.identification import FitSetup, fit
from swashplate.identification.diagnostics import check_runs, refuse_unsound
from swashplate.identification.diagnostics.data_checks import Finding
from swashplate.identification.estimation import smooth
from swashplate.identification.estimation.setup import Free

NOMINAL = smooth(Drive.preset("hoist").parameters)
TRUTH = Drive(NOMINAL).scale(Z10=1.1)


def pump(*names: str) -> FitSetup:
    return FitSetup(part="pump", free=dict.fromkeys(names, Free(relative=(0.5, 2.0))))


PUMP = pump("Z8", "Z10")


def held(volts: float) -> np.ndarray:
    return maneuvers.step(volts, start=0.5, stop=2.5, length=4.0).sample(512.0)


def run(name: str, command: np.ndarray, change=lambda speed: speed, **more: object) -> Experiment:
    """A run of the true drive with noise of 0.6 deg/s; `change` is what goes wrong."""
    noise = np.random.default_rng(7).normal(0.0, 0.01, command.size)
    speed = change(TRUTH.simulate(command).shaft_speed + noise)
    return run_of(name, command, {"shaft_speed": speed}, noise=0.01, **more)


GOOD = (run("up", held(8.0)), run("down", held(-8.0)), run("low", held(3.0)))


def findings(*runs: Experiment) -> list[Finding]:
    return check_runs(runs, NOMINAL)


@pytest.mark.parametrize("axis", ["hoist", "slew", "luff"])
def test_the_sources_campaigns_are_sound(axis: str, tmp_path: Path) -> None:
    campaign = virtual(tmp_path, axis, perturb=0.1, seed=3)
    nominal = smooth(campaign.drive(axis).parameters)
    assert check_runs(campaign.select(role="fit"), nominal) == []
    assert findings(*GOOD) == []


def put(place: int, value: float):
    """A change of one sample."""
    return lambda speed: np.where(np.arange(speed.size) == place, value, speed)


def empty(speed: np.ndarray) -> np.ndarray:
    return np.full_like(speed, np.nan)


FEW = 1.0 * np.isin(np.arange(held(8.0).size), (600, 1200))
"""A weight that leaves two samples."""
SHORT = replace(GOOD[0].input, time=GOOD[0].input.time[:1], values=GOOD[0].input.values[:1])
INFINITE = replace(GOOD[0].input, values=put(3, np.inf)(held(8.0)))


REFUSED = {
    "wrong sign": ((*GOOD, run("again", held(8.0), np.negative)), PUMP, "again .* sign = -1"),
    "all of the wrong sign": (
        [run(f"run {v:g}", held(v), np.negative) for v in (8.0, -3.0, 2.0)],
        PUMP,
        "all 3 runs 'shaft_speed' .* command",
    ),
    "two samples": (
        (run("few", held(8.0), weight=FEW),),
        pump("Z8", "Z16"),
        "2 samples .* 3 parameters",
    ),
    "dead zone": (
        (run("timid", held(0.1)), run("shy", held(-0.05))),
        PUMP,
        "timid: .* 0 and 0.1 V, .* dead zone .*-0.0979 to 0.127 V",
    ),
    "still": (
        (*GOOD, run("dead", held(8.0), np.zeros_like)),
        PUMP,
        "dead: .*'shaft_speed' .*changes",
    ),
    "no number": (
        (*GOOD, run("empty", held(8.0), empty)),
        PUMP,
        "empty: 'shaft_speed' .* 2,049 samples",
    ),
    "one hole": (
        (run("holed", held(8.0), put(512, np.nan)),),
        PUMP,
        "holed: .* 1 sample, .* 1 s",
    ),
    "input": ((*GOOD, replace(GOOD[0], input=INFINITE)), PUMP, "up: .*input .* at sample"),
    "input of one sample": ((replace(GOOD[0], input=SHORT),), PUMP, "up: .*input .* 1 sample"),
    "one sample": (
        (*GOOD, run("one", held(8.0), lambda speed: speed[:1])),
        PUMP,
        "one: .* 1 sample",
    ),
    "nothing depends on it": (GOOD, pump("Z14", "Z15"), "Z14, Z15"),
}


@pytest.mark.parametrize(("runs", "setup", "said"), REFUSED.values(), ids=REFUSED)
def test_what_no_fit_could_mean_anything_for_is_refused(runs, setup: FitSetup, said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        fit(NOMINAL, runs, setup)
    assert "\n" not in str(caught.value)


WARNED = {
    "scale without a twin": ((*GOOD, run("again", held(5.0), lambda v: 4.0 * v)), "4.4 times as"),
    "degrees": ([run(each.name, each.input.values, np.degrees) for each in GOOD], "check its unit"),
    "at rest": ((*GOOD, run("timid", held(0.1))), "it shows the drive only at rest."),
    "ignored": ((*GOOD, run("ignored", held(8.0), empty, weight=0.0)), None),
}


@pytest.mark.parametrize(("runs", "said"), WARNED.values(), ids=WARNED)
def test_what_is_odd_is_said_once(runs, said: str | None) -> None:
    found = refuse_unsound(findings(*runs))
    assert len(found) == (said is not None)
    assert said is None or said in found[0]


def test_a_gross_spike_is_refused_with_the_line_that_leaves_it_out() -> None:
    spoilt = (*GOOD, run("spoilt", held(5.0), put(900, 100.0)))
    with pytest.raises(InputError, match=r"spoilt: .* 1 spike.*ignore = \[\{ from = 1.75"):
        fit(NOMINAL, spoilt, PUMP)
    with pytest.raises(InputError, match="1 spike"):
        guess_drive(spoilt)
    held_out = (*GOOD, replace(spoilt[-1], role="validate"))
    with pytest.raises(InputError, match="1 spike"):
        fit(NOMINAL, Campaign(Path("campaign.toml"), "", False, {}, held_out), PUMP)
    found = fit(NOMINAL, spoilt, PUMP, loss="soft_l1")
    assert any("1 spike" in each for each in found.doubts)
    assert found.parameters.numbers["Z10"] == pytest.approx(TRUTH.parameters.numbers["Z10"], 0.01)


def test_a_position_that_freezes_while_the_drive_runs() -> None:
    """An encoder that hangs from 1.2 to 2.6 s of a step that lasts from 0.5 to 2.5 s."""
    time = np.arange(GOOD[0].input.values.size) / 512.0
    hung = (time > 1.2) & (time < 2.6)

    def turned(run: Experiment, freeze: bool) -> Experiment:
        angle = np.cumsum(TRUTH.simulate(run.input.values).shaft_speed) / 512.0
        if freeze:
            angle[hung] = angle[hung][0]
        return run_of(run.name, run.input.values, {"position": angle}, noise=0.001)

    good = [turned(each, freeze=False) for each in GOOD]
    assert findings(*good) == []
    found = findings(turned(GOOD[0], freeze=True), *good[1:])
    (said,) = [each.sentence for each in found if "up: 'position' does not move" in each.sentence]
    first, last = (float(each) for each in said.partition("from ")[2].split()[:3:2])
    assert 1.2 <= first <= 1.4
    assert 2.4 <= last <= 2.6
