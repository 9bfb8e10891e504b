"""A model of one's own is fitted, predicted, stored and refused as a drive is."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from swashplate import Campaign, Channel, Experiment, FileError, InputError
from swashplate.campaign.experiment import InputSignal, Source
from swashplate.equations import Model, equation
from swashplate.identification import (
    Judged,
    ModelSetup,
    OwnModel,
    Search,
    Unknown,
    assess,
    fit,
    load_fit,
    predict,
    verdict,
)

RATE, COUNT = 50.0, 400
GAIN, LAG = 1.5, 0.3


class Servo(NamedTuple):
    gain: float
    lag: float


class State(NamedTuple):
    place: float


@equation
def step(state: State, command: float, supply: float, p: Servo, h: float) -> State:
    wanted = p.gain * command * supply
    return State(state.place + h / p.lag * (wanted - state.place))


servo = Model("servo", parameters=Servo, state=State, step=step)
FREE = {"gain": (0.1, 1.0, 10.0, "mm/V"), "lag": (0.05, 0.1, 3.0), "start.place": (-9.0, 0.0, 9.0)}
NOISE = {"place": 0.01}


def run(name: str, seed: int, *, begin: float = 0.0, zero: float = 0.0, role="fit") -> Experiment:
    """A test of the servo with two inputs, that begins anywhere and has a sensor's zero."""
    random = np.random.default_rng(seed)
    time = np.arange(COUNT) / RATE
    command = np.repeat(random.uniform(-1.0, 1.0, COUNT // 20), 20)
    supply = 1.0 + 0.2 * np.sin(0.9 * time + seed)
    place, rows = begin, []
    for u, s in zip(command, supply, strict=True):
        rows.append(place)
        place += (GAIN * u * s - place) / (RATE * LAG)
    measured = np.array(rows) + zero + 0.01 * random.standard_normal(COUNT)
    source = Source(Path(f"{name}.csv"), "")
    channels = {
        key: Channel(key, "other", "mm", time, values, np.ones(COUNT), source)
        for key, values in (("place", measured), ("supply", supply))
    }
    signal = InputSignal("other", "V", time, command, "previous", source)
    return Experiment(name, "servo", name, role, "rest", None, signal, channels)


RUNS = (run("one", 1, begin=1.0), run("two", 2, begin=-2.0))
HELD = (run("three", 3, begin=0.5, role="validate"),)


def campaign(*experiments: Experiment) -> Campaign:
    return Campaign(Path("campaign.toml"), "servo", False, {"servo": None}, experiments)


def test_the_truth_is_found_judged_and_predicted() -> None:
    found = fit(servo, campaign(*RUNS, *HELD), FREE, noise=NOISE)
    (stage,) = found.stages
    assert stage.problem.channels == ("place",)
    assert [each.name for each in stage.problem.experiments] == ["one", "two"]
    assert stage.values == pytest.approx(
        {"gain": GAIN, "lag": LAG, "start.place (one)": 1.0, "start.place (two)": -2.0}, abs=0.02
    )
    (assessment,) = assess(found.stages)
    for estimate, truth in zip(
        assessment.uncertainty.estimates, (GAIN, LAG, 1.0, -2.0), strict=True
    ):
        assert estimate.lower < truth < estimate.upper
    (quality,) = predict(found.parameters, HELD)
    assert quality.channel == "place"
    assert quality.measures.rmse == pytest.approx(0.01, rel=0.1)  # the noise, nothing else
    assert verdict([assessment], [quality]).headline.startswith("Usable")


def test_zeros_of_sensors_are_of_each_run() -> None:
    runs = [run("one", 1, zero=0.7), run("two", 2, zero=-0.4)]
    free = {"gain": (0.1, 1.0, 10.0), "lag": (0.05, 0.1, 3.0), "offset place": (-2.0, 0.0, 2.0)}
    (stage,) = fit(servo, runs, free, noise=NOISE).stages
    assert stage.values == pytest.approx(
        {"gain": GAIN, "lag": LAG, "offset place (one)": 0.7, "offset place (two)": -0.4}, abs=0.02
    )


class Table:
    """The servo as a program of others, with names that mean something to nobody else."""

    name = "table"

    def simulate(self, values, experiment):
        place, rows, supply = 0.0, [], experiment["supply"].values
        for u, s in zip(experiment.input.values, supply, strict=True):
            rows.append(place)
            place += (values["offset slope"] * u * s - place) / (RATE * values["start.lag"])
        return {"place": np.array(rows)}


def test_a_name_that_begins_like_a_sensors_zero_is_the_models() -> None:
    free = {"offset slope": (0.1, 1.0, 10.0), "start.lag": (0.05, 0.1, 3.0)}
    found = fit(Table(), [run("one", 1), run("two", 2)], free, noise=NOISE)
    assert found.stages[0].solution.converged
    assert found.parameters.numbers == pytest.approx(
        {"offset slope": GAIN, "start.lag": LAG}, abs=0.01
    )
    assert found.stages[0].solution.cost == pytest.approx(COUNT, rel=0.1)  # noise of deviation 1


def test_a_fit_comes_back_with_its_model_alone(tmp_path: Path) -> None:
    tests, path = campaign(*RUNS), tmp_path / "fit.json"
    found = fit(servo, tests, FREE, noise=NOISE)
    Judged(tests, found, RUNS).store(path)
    with pytest.raises(InputError, match="give that, with --model"):
        load_fit(path, tests)
    with pytest.raises(InputError, match="another model, or of other bounds"):
        load_fit(path, tests, model=ModelSetup(servo, {**FREE, "lag": (0.1, 0.2, 3.0)}))
    again = load_fit(path, tests, model=ModelSetup(servo, FREE, noise=NOISE)).result
    assert again.parameters.numbers == found.parameters.numbers
    assert assess(again.stages)[0].uncertainty.estimates == (
        assess(found.stages)[0].uncertainty.estimates
    )


def test_starts_of_other_steps_are_not_resumed(tmp_path: Path) -> None:
    search = Search(1, store=tmp_path, resume=True)
    found = fit(OwnModel(servo), RUNS, FREE, noise=NOISE, search=search)
    assert len(found.stages[0].starts) == 2
    with pytest.raises(FileError, match="nominal values differ"):
        fit(OwnModel(servo, substeps=2), RUNS, FREE, noise=NOISE, search=search)


def test_what_a_range_means() -> None:
    setup = ModelSetup(OwnModel(servo), FREE)
    assert setup.name == "servo"
    assert [each.log for each in setup.free.values()] == [True, True, False]
    assert setup.free["gain"].unit == "mm/V"
    own = Unknown("lag", 0.1, 0.05, 3.0)
    assert ModelSetup(servo, {"lag": own}, fixed={"gain": 1.0}).free["lag"] is own


def changed(experiment: Experiment, values: np.ndarray, name: str = "") -> Experiment:
    place = replace(experiment["place"], values=values, noise=0.01)
    channels = {**experiment.channels, "place": place}
    return replace(experiment, name=name or experiment.name, channels=channels)


def test_data_are_checked_before_the_search() -> None:
    first, second = RUNS
    holed = np.where(np.arange(COUNT) == 50, np.nan, first["place"].values)
    with pytest.raises(
        InputError, match="one: 'place' is not finite in 1 sample, the first at 1 s"
    ):
        fit(servo, [changed(first, holed), second], FREE, noise=NOISE)
    twice = fit(servo, [*RUNS, replace(first, name="copy")], FREE, noise=NOISE)
    (said,) = twice.doubts
    assert said.startswith("copy has the samples of one, to the last bit, and counts twice")
    still = fit(servo, [*RUNS, changed(first, np.zeros(COUNT), "still")], FREE, noise=NOISE)
    (said,) = still.doubts
    assert said.startswith("still: 'place' never changes, though the input does")
    idle = [replace(each, input=replace(each.input, values=np.zeros(COUNT))) for each in RUNS]
    fixed = {"lag": 0.3}
    with pytest.raises(
        InputError, match="servo: no run depends on any of gain; free what the runs"
    ):
        fit(servo, idle, {"gain": FREE["gain"]}, noise=NOISE, fixed=fixed)
    assert fit(servo, RUNS, FREE, noise=NOISE).doubts == ()


def test_refusals(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="A dict is no model"):
        fit({}, RUNS, FREE)
    with pytest.raises(InputError, match="Nothing of servo is free"):
        fit(servo, RUNS, {})
    with pytest.raises(InputError, match="lag is free as 3: give lower bound"):
        fit(servo, RUNS, {"lag": 3})
    with pytest.raises(InputError, match="no parameter 'lagg'; it has gain, lag"):
        fit(servo, RUNS, {"lagg": (0.1, 0.2, 3.0)}, fixed={"gain": 1.0, "lag": 1.0})
    with pytest.raises(InputError, match="There is no run to fit"):
        fit(servo, [], FREE)
    dumb = [replace(each, channels={"supply": each["supply"]}) for each in RUNS]
    with pytest.raises(InputError, match="servo gives none"):
        fit(servo, dumb, FREE)
    monkeypatch.syspath_prepend(tmp_path)
    for name, text, error, sentence in (
        ("bare", "model = 1\n", InputError, "bare.py has no 'free'"),
        ("json", "model = free = 1\n", FileError, "another module is called json"),
    ):
        (tmp_path / f"{name}.py").write_text(text, "utf-8")
        with pytest.raises(error, match=sentence):
            ModelSetup.from_file(tmp_path / f"{name}.py")
    with pytest.raises(FileError, match="no Python file"):
        ModelSetup.from_file(tmp_path / "none.py")
