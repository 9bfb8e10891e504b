"""From a campaign to drive and verdict in one call, and back from the folder that it wrote."""

import csv
import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import exp
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from tests.identification.given import FEW, FORCES, determined_of, virtual

import swashplate
from swashplate import (
    Campaign,
    Drive,
    Experiment,
    Identification,
    InputError,
    ParameterError,
    SwashplateError,
    maneuvers,
)
from swashplate.identification import ModelSetup, Search, fit, load_setup, whole_drive
from swashplate.identification.estimation.setup import Free, setup_text
from swashplate.machine import Model

TRUTH = {"J_plus": 0.26, "J_minus": 0.31, "Z10": 13.0}


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """Two short tests of a hoist to fit and one to predict, as a campaign file."""
    levels = (4.0, -4.0, 5.0)
    commands = [maneuvers.step(level, start=0.5, stop=2.5, length=4.0) for level in levels]
    drive = Drive.preset("hoist").replace(J=(0.26, 0.31), Z10=13.0)
    folder = tmp_path_factory.mktemp("tests")
    virtual(folder, "hoist", commands, seed=2, truth=drive)
    (path,) = folder.rglob("campaign.toml")
    before, _, after = path.read_text("utf-8").rpartition('role = "fit"')
    path.write_text(f'{before}role = "validate"{after}', "utf-8")
    return Campaign.from_toml(path)


@pytest.fixture(scope="module")
def result(campaign: Campaign) -> Identification:
    """Of a number of the card and one of the pump."""
    return swashplate.identify(campaign, free=FEW)


def test_the_campaigns_stick_travels_with_the_drive(result: Identification, tmp_path: Path) -> None:
    """The offset of a stick that rests at 5 V would be lost with the campaign."""
    assert result.drive.parameters.command is None  # as logged, these are the card's volts
    (name, axis), *_ = result.campaign.axes.items()
    stick = {"column": "Joystick", "offset": -5.0, "sign": -1}
    stated = axis.model_copy(update={"input": axis.input.model_copy(update=stick)})
    tests = replace(result.campaign, axes={name: stated})
    replace(result, campaign=tests).save(tmp_path)
    command = Drive.from_toml(tmp_path).parameters.command
    assert (command.column, command.offset, command.sign) == ("Joystick", -5.0, -1)


def test_the_truth_is_found_and_judged(result: Identification) -> None:
    for name, true in TRUTH.items():
        estimate = result[name]
        low, high = estimate.interval
        assert low is not None
        assert high is not None
        assert low < true < high, name
        assert estimate.value == pytest.approx(true, rel=0.01)
        assert estimate.free
        assert estimate.standard_error is not None
        assert 0.0 < estimate.standard_error < high - low
    assert (result["Z10"].unit, result["J_plus"].unit) == ("1/s", "A")
    assert result.verdict.usable
    assert len(result.predicted) == 2  # counts and current of the run that was held out


def test_what_stayed_fixed_says_so(result: Identification) -> None:
    hoist = Drive.preset("hoist")
    fixed = result["Z9"]
    assert (fixed.status, fixed.free) == ("fixed", False)
    assert fixed.value == hoist["Z9"].value
    assert (fixed.standard_error, fixed.interval, fixed.unit) == (None, (None, None), "Pa")


def test_names_follow_the_contract_of_a_mapping(result: Identification) -> None:
    assert "Z10" in result
    assert "Z99" not in result
    assert set(result) == set(result.fit.estimates)
    assert len(result) == len(list(result))
    assert result["Z10"] == result.fit["Z10"]
    with pytest.raises(KeyError, match="J .* J_plus or J_minus"):
        result["J"]
    with pytest.raises(KeyError, match="mean Z10"):
        result["Z100"]


def test_the_fitted_drive_knows_where_it_is_from(result: Identification) -> None:
    drive = result.drive
    assert drive["Z10"].value == result["Z10"].value
    assert drive["Z10"].status == "fitted"
    assert "campaign.toml" in drive["Z10"].source
    assert drive["Z9"].status == "fixed"
    assert drive["Z9"].source.startswith("hoist")


def test_a_table_of_what_was_estimated(result: Identification, tmp_path: Path) -> None:
    frame = result.to_polars()
    rows = {row["parameter"]: row for row in frame.iter_rows(named=True)}
    assert "Z9" not in rows
    for name in TRUTH:
        estimate, row = result[name], rows[name]
        assert [row[key] for key in ("value", "standard_error", "lower", "upper", "unit")] == [
            estimate.value,
            estimate.standard_error,
            estimate.lower,
            estimate.upper,
            estimate.unit,
        ]
    assert [*result.to_pandas().columns] == frame.columns
    result.save(tmp_path)
    with (tmp_path / "estimates.csv").open(encoding="utf-8") as file:
        reader = csv.DictReader(file)
        assert reader.fieldnames == frame.columns
        stored = {row["parameter"]: float(row["value"]) for row in reader}
    assert stored == {name: row["value"] for name, row in rows.items()}


@pytest.mark.slow
def test_a_folder_comes_back_with_the_same_interface(
    result: Identification, tmp_path: Path
) -> None:
    files = result.save(tmp_path / "fitted")
    names = ["drive.toml", "setup.toml", "estimates.csv", "fit.json"]
    assert [file.name for file in files] == names
    assert all(file.is_file() for file in files)
    assert load_setup(tmp_path / "fitted" / "setup.toml") == FEW
    for place in (tmp_path / "fitted", str(tmp_path / "fitted"), files[-1], files[0]):
        again = Identification.load(place)
        assert again["Z10"] == result["Z10"]
    assert again.drive == result.drive
    assert again.verdict.headline == result.verdict.headline
    # every face that takes a drive takes the folder
    assert Drive.from_toml(tmp_path / "fitted") == result.drive
    went_on = swashplate.identify(result.campaign, tmp_path / "fitted", {"Z8": (0.5, 2.0)})
    assert went_on["Z10"].value == result["Z10"].value
    assert went_on["Z10"].status == "fixed"


@pytest.mark.slow
def test_a_report_is_written(result: Identification, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    assert result.report(page, truth=Drive.preset("hoist")) == page
    page = (tmp_path / "report.html").read_text("utf-8")
    assert "Usable" in result.verdict.headline
    assert "Usable" in page
    assert f"{result['Z10'].value:.2f}" in page
    assert '<th class="n">truth</th>' in page


def estimates(result: Identification) -> Mapping[str, float]:
    return {name: result[name].value for name in result if "(" not in name}


def configured(path: Path) -> Path:
    path.write_text(setup_text(FEW), "utf-8")
    return path


def in_stages() -> dict[str, Any]:
    """`FEW` as it was written while a fit had stages."""
    content = FEW.model_dump(exclude_defaults=True)
    title = content.pop("title")
    return {"title": title, "stages": [{"name": "few", "part": "chain", **content}]}


FORMS: Mapping[str, Callable[[Campaign, Path], tuple[Any, Any, Any]]] = {
    "paths": lambda tests, folder: (tests.path, None, configured(folder / "mine.toml")),
    "texts": lambda tests, folder: (str(tests.path), "hoist", str(configured(folder / "x.toml"))),
    "a drive": lambda tests, _: (tests, Drive.preset("hoist"), FEW),
    "a set": lambda tests, _: (tests, Drive.preset("hoist").parameters, FEW),
    "a file's contents": lambda tests, _: (tests, None, FEW.model_dump()),
    "those of an earlier version": lambda tests, _: (tests, None, in_stages()),
}


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_each_form_of_the_arguments_is_the_same(form, result, campaign, tmp_path) -> None:
    tests, model, free = form(campaign, tmp_path)
    again = swashplate.identify(tests, model, free)
    assert again.fit.setup == FEW
    assert estimates(again) == estimates(result)


@pytest.mark.slow
def test_drive_and_configuration_come_from_the_campaign(campaign: Campaign) -> None:
    found = swashplate.identify(campaign.path)
    assert found.fit.setup == whole_drive(Drive.preset("hoist").parameters)
    assert found.fit.nominal.name == "hoist"


PARTS: Mapping[str, tuple[Mapping[str, Any], str]] = {
    "pump and motor": ({"Z8": (0.5, 2), "Z16_plus": [0.5, 2.0]}, "pump"),
    "the card": ({"J": Free(relative=(0.5, 2.0), log=True)}, "card"),
    "both": ({"G1": (0.5, 2), "Z10": {"bounds": [5.0, 20.0], "log": True}}, "chain"),
}


@pytest.mark.slow
@pytest.mark.parametrize(("free", "part"), PARTS.values(), ids=PARTS)
def test_a_mapping_names_what_is_free(campaign: Campaign, free, part: str) -> None:
    found = swashplate.identify(campaign, free=free)
    assert found.fit.setup.part == part
    machine = {each.name: each for each in found.fit.problem.unknowns if each.run is None}
    symbols = {name.removesuffix("_plus").removesuffix("_minus") for name in machine}
    assert symbols == {name.removesuffix("_plus") for name in free}
    for name, entry in free.items():
        unknown = machine.get(name, machine.get(f"{name}_plus"))
        assert unknown is not None
        nominal = Drive.preset("hoist")[unknown.name].value
        if isinstance(entry, Mapping):
            assert (unknown.low, unknown.high, unknown.log) == (5.0, 20.0, True)
        else:
            assert (unknown.low, unknown.high) == (0.5 * nominal, 2.0 * nominal)
    assert fit(Drive.preset("hoist"), campaign, free).setup == found.fit.setup


def test_a_tied_parameter_has_its_estimate_by_every_name(campaign: Campaign) -> None:
    found = swashplate.identify(campaign, free={"J": {"relative": (0.5, 2), "tied": True}})
    assert found["J"] is found["J_plus"] is found["J_minus"]
    assert found["J"].free


def with_drive(campaign: Campaign, name: str) -> Campaign:
    axis = campaign.axes["hoist"].model_copy(update={"drive": name})
    return replace(campaign, axes={"hoist": axis})


def two_axes(campaign: Campaign) -> Campaign:
    return replace(campaign, axes={**campaign.axes, "slew": campaign.axes["hoist"]})


def pump(**entries: object) -> dict[str, object]:
    """A fit setup of the pump alone."""
    return {"part": "pump", "free": {"Z8": {"relative": (0.5, 2.0)}}} | entries


REFUSED: Mapping[str, tuple[Callable[[Campaign], object], type[Exception], str]] = {
    "another axis": (
        lambda tests: swashplate.identify(tests, axis="slew"),
        InputError,
        "axis 'slew'; .* hoist",
    ),
    "logs instead of a campaign": (
        lambda tests: swashplate.identify(["up.csv", "down.csv"]),
        TypeError,
        "draft_campaign",
    ),
    "several axes": (
        lambda tests: swashplate.identify(two_axes(tests)),
        InputError,
        "axes hoist, slew; name one",
    ),
    "no run": (
        lambda tests: swashplate.identify(replace(tests, experiments=tests.experiments[2:])),
        InputError,
        "axis 'hoist' .* role 'fit'",
    ),
    "an unknown parameter": (
        lambda tests: swashplate.identify(tests, free={"Z88": (0.5, 2)}),
        ParameterError,
        "Z88.* mean Z8",
    ),
    "one number": (
        lambda tests: swashplate.identify(tests, free={"Z8": 0.5}),
        ParameterError,
        "Z8 .* 0.5: .* two factors",
    ),
    "falling factors": (
        lambda tests: swashplate.identify(tests, free={"Z8": (2, 0.5)}),
        ParameterError,
        r"free, Z8: .*\[0.5, 2\]",
    ),
    "a factor that no machine has": (
        lambda tests: swashplate.identify(tests, free={"Z8": (0.5, 1e300)}),
        ParameterError,
        r"bound of Z8 .* 1.6514e\+306 sqrt\(Pa\)/\(m s\), .* 10 to 1e\+11 sqrt",
    ),
    "a bound in another unit": (
        lambda tests: swashplate.identify(tests, free={"Z9": {"bounds": (50.0, 2e7)}}),
        ParameterError,
        r"bound of Z9 .* 50 Pa, .* 10000 to 1e\+09 Pa: .* bar .* Pa",
    ),
    "a force that no solenoid has": (
        lambda tests: swashplate.identify(
            tests, free=pump(forces=FORCES | {"relative": (0.5, 1e6)})
        ),
        ParameterError,
        r"bound of force_plus_1 .* N, .* 10000 N",
    ),
    "a start pressure that no machine has": (
        lambda tests: swashplate.identify(tests, free=pump(start_pressure=1e300)),
        ParameterError,
        r"start_pressure .* 1e\+300, .* 10000000000",
    ),
    "a prior in another unit": (
        lambda tests: swashplate.identify(
            tests,
            free={"Z9": {"bounds": (5e6, 2e7), "prior": {"mean": 107.0, "deviation": 10.0}}},
        ),
        ParameterError,
        r"prior mean of Z9 .* 107 Pa, .* bar .* Pa",
    ),
    "nothing": (
        lambda tests: swashplate.identify(tests, free={}),
        InputError,
        "free parameters are {}",
    ),
    "an unknown fit setup": (
        lambda tests: swashplate.identify(tests, free="hoost"),
        ParameterError,
        r"'hoost' is no fit setup: give a \.toml file",
    ),
    "an unknown drive": (
        lambda tests: swashplate.identify(tests, "hoost"),
        FileNotFoundError,
        "set, file or folder 'hoost' .* hoist",
    ),
    "a model without what is free": (
        lambda tests: swashplate.identify(tests, lag_model()),
        InputError,
        "mapping of .* free",
    ),
    "neither a drive nor a model": (
        lambda tests: swashplate.identify(tests, 5),
        TypeError,
        "model .* 5: give a Drive, .* 'hoist'",
    ),
    "starts below none": (
        lambda tests: swashplate.identify(tests, starts=-1),
        InputError,
        "starts .* -1, .* whole number of 0",
    ),
    "half an evaluation": (
        lambda tests: swashplate.identify(tests, max_evaluations=0.5),
        InputError,
        "max_evaluations .* 0.5, .* whole number of 1",
    ),
    "another loss": (
        lambda tests: swashplate.identify(tests, loss="lin"),
        InputError,
        "loss .* 'lin', .* linear, soft_l1, cauchy",
    ),
    "no error at all": (
        lambda tests: swashplate.identify(tests, required=0.0),
        InputError,
        "required .* 0.0, .* above 0",
    ),
    "several stages": (
        lambda tests: swashplate.identify(tests, free={"stages": [pump(), pump()]}),
        ParameterError,
        "no stages any more: .* one after another, each --from",
    ),
    "an unknown parameter of a fit setup": (
        lambda tests: swashplate.identify(tests, free=pump(free={"Z88": {"relative": (0.5, 2.0)}})),
        KeyError,
        "fit setup, free: .*'Z88'.* Z8",
    ),
    "an unknown parameter that is uncertain": (
        lambda tests: swashplate.identify(tests, free=pump(standard_uncertainty={"Z99": 1.0})),
        KeyError,
        "standard_uncertainty: .*'Z99'.* Z9",
    ),
    "another name in a model's free": (
        lambda tests: swashplate.identify(tests, lag_model(), {"lagg": (0.01, 0.1, 3.0)}),
        KeyError,
        "lag .* 'lagg', .* free .* lag",
    ),
    "another name in a model's fixed": (
        lambda tests: ModelSetup(lag_model(), {"lag": (0.01, 0.1, 3.0)}, fixed={"gian": 1.0}),
        KeyError,
        "'gian', .* fixed .* gain",
    ),
    "a profile of nothing": (
        lambda tests: swashplate.identify(tests, free={"Z8": (0.5, 2)}, profiles=["Z9"]),
        InputError,
        "parameter 'Z9'; .* Z8",
    ),
    "an identification to export": (
        lambda tests: swashplate.export.fmu(Identification(tests, None), "hoist.fmu"),
        TypeError,
        r"give a Drive.*identification.drive",
    ),
    "a campaign with an unknown drive": (
        lambda tests: swashplate.identify(with_drive(tests, "hoost")),
        ParameterError,
        r"campaign.toml, \[axes.hoist\]: .*'hoost' .* hoist",
    ),
    "an unknown packaged drive": (
        lambda _: Drive.preset("hoost"),
        ParameterError,
        "'hoost' .* hoist",
    ),
    "a fit without what is free": (
        lambda tests: fit(Drive.preset("hoist"), tests),
        InputError,
        "swashplate.identify .* campaign",
    ),
}


@pytest.mark.parametrize(("call", "kind", "sentence"), REFUSED.values(), ids=REFUSED)
def test_what_does_not_fit_is_refused(campaign: Campaign, call, kind, sentence: str) -> None:
    with pytest.raises(kind, match=sentence) as caught:
        call(campaign)
    assert isinstance(caught.value, SwashplateError)


SINES = (maneuvers.sine(9.0, 0.1), maneuvers.sine(6.5, 0.3), maneuvers.sine(9.0, 0.3))
PUMP = dict.fromkeys(("Z1", "Z3", "Z8", "Z10", "Z16"), (0.5, 2.0))


def spoiled(campaign: Campaign, name: str, change: Callable[..., np.ndarray]) -> list[Experiment]:
    """Its runs with other samples of one channel: a function of this and of the next run's."""
    runs, made = campaign.select(role="fit"), []
    for run, other in zip(runs, [*runs[1:], runs[0]], strict=True):
        channel, theirs = run[name], other[name]
        values = change(channel.values, np.interp(channel.time, theirs.time, theirs.values))
        made.append(replace(run, channels={name: replace(channel, values=values)}))
    return made


@pytest.mark.slow
def test_runs_that_no_drive_fits_are_refused_after_a_few_evaluations(tmp_path: Path) -> None:
    """The encoder of each run saw another run's command."""
    tests = virtual(tmp_path, "hoist", SINES)
    strange = spoiled(tests, "counts", lambda own, other: other)
    iterations = []
    with pytest.raises(InputError, match=r"best of 7 starts explains \d+ % .*counts"):
        fit(Drive.preset("hoist"), strange, PUMP, watch=lambda *now: iterations.append(now))
    assert len(iterations) <= 31  # of the first search
    # whoever asks for it gets the search to its end, and a verdict
    assert fit(Drive.preset("hoist"), strange, PUMP, search=Search(0), max_evaluations=40)


@pytest.mark.slow
def test_a_gross_fault_that_leaves_something_to_see_is_fitted(tmp_path: Path) -> None:
    """An ammeter that ends at half of its range: 30 evaluations do, but are not the end."""
    tests = virtual(tmp_path, "hoist", SINES)
    largest = max(float(run["current"].values.max()) for run in tests)
    clipped = spoiled(tests, "current", lambda own, other: np.minimum(own, 0.5 * largest))
    card = determined_of("hoist", "card")
    found = fit(Drive.preset("hoist"), clipped, card, max_evaluations=70)
    assert found.solution.evaluations > 30


@pytest.mark.slow
def test_more_than_a_fit_is_asked_for_by_keywords(
    campaign: Campaign, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("DEBUG", "swashplate")
    found = swashplate.identify(
        campaign,
        free={"Z10": (0.5, 2.0)},
        profiles=["Z10"],
        starts=2,
        seed=3,
    )
    assert [profile.name for profile in found.profiles] == ["Z10"]
    assert len(found.fit.starts) == 3
    assert found.notes["seed"] == "3"
    assert any("3 of 3 starts" in message for message in caplog.messages)


def test_after_an_interruption_nothing_else_is_computed(
    campaign: Campaign, caplog: pytest.LogCaptureFixture
) -> None:
    def press_ctrl_c(record: logging.LogRecord) -> bool:
        if record.levelno == logging.DEBUG:
            raise KeyboardInterrupt
        return True

    caplog.set_level("DEBUG", "swashplate")
    logger = logging.getLogger("swashplate")
    logger.addFilter(press_ctrl_c)
    try:
        found = swashplate.identify(campaign, free={"Z10": (0.5, 2.0)}, profiles="all")
    finally:
        logger.removeFilter(press_ctrl_c)
    assert found.fit.interrupted
    assert not found.profiles


# --- user-defined models --------------------------------------------------------------------------


class Lag(NamedTuple):
    lag: float
    gain: float


class Speed(NamedTuple):
    speed: float


def step(state: Speed, voltage: float, p: Lag, h: float) -> Speed:
    share = 1.0 - exp(-h / p.lag)
    return Speed(state.speed + share * (p.gain * voltage - state.speed))


def lag_model() -> Model:
    return Model("lag", parameters=Lag, state=Speed, step=step)


RANGES = {"lag": (0.01, 0.1, 3.0, "s"), "gain": (0.05, 0.5, 5.0, "rad/(s V)")}


@pytest.fixture(scope="module")
def turning(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """A motor of first order, 0.3 s and 0.8 rad/s per volt, in three logs."""
    folder = tmp_path_factory.mktemp("turning")
    random, time = np.random.default_rng(1), np.arange(400) / 50.0
    text = '[axes.motor]\ntime = { column = "time" }\nstart = "rest"\n'
    text += 'input = { column = "voltage", kind = "voltage", interpolation = "previous" }\n'
    text += "channels.speed = { column = 'speed', kind = 'shaft_speed', "
    text += "noise = 0.01 }\n"
    for name, level, role in (("a", 4.0, "fit"), ("b", -3.0, "fit"), ("c", 5.0, "validate")):
        voltage, speed = np.where(time % 4.0 < 2.0, level, 0.0), np.zeros(time.size)
        for k in range(1, time.size):
            change = 1.0 - exp(-0.02 / 0.3)
            speed[k] = speed[k - 1] + change * (0.8 * voltage[k - 1] - speed[k - 1])
        rows = np.column_stack([time, voltage, speed + random.normal(0.0, 0.01, time.size)])
        lines = [",".join(f"{number:.6g}" for number in row) for row in rows]
        (folder / f"{name}.csv").write_text("\n".join(["time,voltage,speed", *lines]), "utf-8")
        text += f'[[runs]]\nfile = "{name}.csv"\nrole = "{role}"\n'
    (folder / "campaign.toml").write_text(text, "utf-8")
    return Campaign.from_toml(folder / "campaign.toml")


def test_a_user_defined_model_has_the_same_interface(turning: Campaign, tmp_path: Path) -> None:
    found = swashplate.identify(turning, lag_model(), RANGES)
    for name, true in {"lag": 0.3, "gain": 0.8}.items():
        low, high = found[name].interval
        assert low is not None
        assert high is not None
        assert low < true < high
    assert found["lag"].unit == "s"
    assert found.verdict.usable
    assert found.to_polars()["parameter"].to_list() == ["lag", "gain"]
    with pytest.raises(InputError, match="user-defined model, not a drive"):
        _ = found.drive
    setup = ModelSetup(lag_model(), RANGES)
    again = swashplate.identify(turning, setup)
    assert again["lag"].value == found["lag"].value
    with pytest.raises(InputError, match="free parameters"):
        swashplate.identify(turning, setup, RANGES)
    files = found.save(tmp_path)
    assert [file.name for file in files] == ["parameters.toml", "estimates.csv", "fit.json"]
    back = Identification.load(tmp_path, model=setup)
    assert back["gain"] == found["gain"]
    with pytest.raises(FileNotFoundError, match=f"{tmp_path.name} .*user-defined model"):
        Drive.from_toml(tmp_path)
