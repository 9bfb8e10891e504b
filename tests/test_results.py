"""Results as Python shows them: at the prompt, in a notebook, in other libraries' frames."""

import importlib
import inspect
import pkgutil
import re
import sys
import tomllib
import types
from collections.abc import Iterable
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from tests.identification.given import FEW, virtual
from typer.testing import CliRunner

import swashplate
from swashplate import Campaign, Drive, FullOrderDrive, InputError, Limit, SquaredError, maneuvers
from swashplate.analysis import (
    Requirements,
    envelope,
    inverse_map,
    limit_shares,
    one_at_a_time,
    size,
    trial_of,
    what_if,
)
from swashplate.campaign import examine
from swashplate.cli import app
from swashplate.crane import (
    Crane,
    CraneStepper,
    OperatorCommand,
    Seaway,
    TransferFunctions,
    control,
    simulate,
)
from swashplate.drafting import guess_drive
from swashplate.full_order import compare
from swashplate.identification import Fit, Identification, fit, predict, run_information
from swashplate.results import LONGEST

API = Path(__file__).parents[1] / "docs" / "api.toml"
TESTS = [maneuvers.step(volts, stop=3.0, length=4.0) for volts in (4.0, -5.0, 9.0)]


class Work(NamedTuple):
    """A campaign, a fit of it and what was found out about it."""

    campaign: Campaign
    fitted: Fit
    judged: Any


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Work:
    campaign = virtual(tmp_path_factory.mktemp("tests"), "hoist", TESTS, seed=1)
    fitted = fit(Drive.preset("hoist"), campaign, FEW)
    judged = Identification(campaign, fitted)
    return Work(campaign, fitted, judged)


def public_classes() -> dict[str, type]:
    """Every class of the API reference, by its name there."""
    found = {}
    for page in tomllib.loads(API.read_text("utf-8"))["page"]:
        for entry in page["objects"]:
            name = entry if isinstance(entry, str) else entry["name"]
            module, _, attribute = name.rpartition(".")
            made = getattr(importlib.import_module(module), attribute)
            if inspect.isclass(made) and not issubclass(made, BaseException):
                found[name] = made
    return found


def reached(roots: Iterable[object]) -> dict[type, int]:
    """The longest repr of each of the package's classes among objects and all that they hold."""
    longest: dict[type, int] = {}
    left, seen = list(roots), set[int]()
    while left:
        each = left.pop()
        if id(each) in seen or isinstance(each, str | np.ndarray | type | types.FunctionType):
            continue
        seen.add(id(each))
        if type(each).__module__.startswith("swashplate"):
            longest[type(each)] = max(longest.get(type(each), 0), len(repr(each)))
            left += getattr(each, "__dict__", {}).values()
        if isinstance(each, dict | types.MappingProxyType):
            left += each.values()
        elif isinstance(each, list | tuple):
            left += each
    return longest


def analyses(drive: Drive) -> list[Any]:
    """What the package of analyses finds out about a drive."""
    voltage = TESTS[0].sample()
    once = trial_of(drive, voltage)
    return [
        envelope(drive),
        limit_shares(drive, voltage),
        what_if(drive, {"orifice": 1.5}, once),
        size(drive, Requirements(speed=3.5), {"pump": (1.0, 2.0)}),
        inverse_map(drive),
        one_at_a_time(drive, {"orifice": (0.9, 1.1)}, once, outcomes=["final_speed", "rise_time"]),
    ]


def cranes() -> list[object]:
    """A crane, a run of it, and what they are made of."""
    crane = Crane.preset("tg3637")
    command = OperatorCommand.trapezoid(slew=0.5, duration=2.0, length=10.0)
    waves = Seaway("ss3", 90.0, seed=1)
    feedback = control.TipShaper("zv") | control.DelayedFeedback(0.2, delay=0.2) | control.Clip()
    run = simulate(crane, command, sea=waves, control=feedback)
    values = np.zeros((1, 2, 30, 6), dtype=np.complex128)
    grid = TransferFunctions(
        "box", np.zeros(1), np.array([0.0, np.pi]), np.linspace(0.5, 2.0, 30), values
    )
    parts = (control.TipShaper("zvd"), control.ShipCompensation(), control.PositionLoop(0.7))
    return [crane, command, waves, feedback, *parts, run, grid, CraneStepper(crane)]


@pytest.mark.slow  # all that the package makes is made once
def test_every_public_class_has_a_short_repr(work: Work) -> None:
    hoist = Drive.preset("hoist")
    voltage = TESTS[0].sample()
    response = hoist.frequency_response([0.3, 1.0], [2.0])
    five = FullOrderDrive.preset("hoist")
    runs = work.campaign.select(role="fit")
    sizes = reached(
        [
            *work,
            hoist,
            hoist.simulate(voltage),
            hoist.sensitivities(voltage),
            hoist.simulate_many({"Z16": [1e-4, 2e-4]}, voltage=voltage),
            hoist.stepper(),
            hoist.linearize(1.5),
            response,
            SquaredError(voltage),
            five,
            five.simulate(voltage),
            compare(five, five.drive.simulate(voltage)),
            run_information(work.fitted.setup, hoist, runs),
            guess_drive(runs),
            *analyses(hoist),
            examine(runs[0]),
            *cranes(),
            swashplate.Threads(),
            swashplate.Processes(),
            swashplate.Dask("tcp://scheduler:8786"),
        ]
    )
    # numbers of the machine and of its equations, and settings of the march, are spelt out
    inner = ("models", "machine", "crane.stages", "crane.motion", "crane.closed_loop.stepper")
    inner = tuple(f"swashplate.{module}" for module in inner)
    own = {kind: n for kind, n in sizes.items() if not kind.__module__.startswith(inner)}
    assert {kind: n for kind, n in own.items() if n > LONGEST + 40} == {}
    for name, kind in public_classes().items():
        # a dataclass's own repr will do where there is nothing but numbers, words and models
        if hasattr(kind.__repr__, "__wrapped__") and kind not in sizes:
            kinds = {str(each) for each in getattr(kind, "__annotations__", {}).values()}
            plain = r"((float|int|str|bool|None|Any|Model|Annotated\[float, .*\])( \| )?)+"
            assert all(re.fullmatch(plain, each) for each in kinds), name


def test_a_run_is_read_by_its_signals_names() -> None:
    hoist = Drive.preset("hoist")
    run = hoist.simulate(TESTS[0])
    assert run["shaft_speed"] is run.shaft_speed
    assert all(run[name].shape == run.time.shape for name in run.names)
    with pytest.raises(InputError, match=r"'shaft_sped'.* shaft_speed"):
        run["shaft_sped"]
    assert np.array_equal(run.active("orifice"), run.active(Limit.ORIFICE))
    assert run.active("orifice").any()
    with pytest.raises(InputError, match="limit 'orifise'.* dead_zone"):
        run.active("orifise")
    current = hoist.simulate_current(run.current)
    assert "voltage" not in current.names
    full = FullOrderDrive.preset("hoist").simulate(TESTS[0].sample())
    assert full["pump_flow"] is full.pump_flow


def test_a_maneuver_stands_where_a_voltage_does() -> None:
    hoist, command = Drive.preset("hoist"), TESTS[1]
    samples = command.sample(256.0)
    same = np.array_equal
    assert same(hoist.simulate(command, 256.0)["current"], hoist.simulate(samples, 256.0).current)
    found = hoist.sensitivities(command, parameters=["Z8"])["shaft_speed"]
    assert same(found, hoist.sensitivities(command.sample(), parameters=["Z8"])["shaft_speed"])
    many = hoist.simulate_many({"Z8": [1.6e6]}, voltage=command).output
    given = hoist.simulate_many({"Z8": [1.6e6]}, voltage=command.sample()).output
    assert many is not None
    assert given is not None
    assert same(many, given)
    with pytest.raises(InputError, match=r"maneuvers\.parse\('step:9'\)"):
        hoist.simulate("step:9")


def test_frames_of_other_libraries(monkeypatch: pytest.MonkeyPatch) -> None:
    run = Drive.preset("hoist").simulate(TESTS[0])
    pytest.importorskip("pandas")
    frame = run.to_pandas()
    assert list(frame.columns) == run.to_polars().columns
    assert np.array_equal(frame["shaft_speed"], run.shaft_speed)
    # what xarray is called with, whether it is installed or not

    def dataset(data: dict[str, Any], coordinates: dict[str, Any]) -> tuple[Any, Any]:
        return data, coordinates

    monkeypatch.setitem(sys.modules, "xarray", types.SimpleNamespace(Dataset=dataset))
    data, along = run.to_xarray()
    assert list(along) == ["time"]
    assert data["shaft_speed"][0] == "time"
    assert np.array_equal(data["shaft_speed"][1], run.shaft_speed)
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(InputError, match="xarray"):
        run.to_xarray()


def test_a_figure_of_chosen_signals() -> None:
    run = Drive.preset("hoist").simulate(TESTS[0])
    assert len(run.plot().axes) > 4
    two = run.plot(["shaft_speed", "stroker_pressure"])
    assert [each.get_ylabel().replace("\n", " ") for each in two.axes] == [
        "shaft speed (deg/s)",
        "stroker pressure (bar)",
    ]
    assert two.axes[-1].get_xlabel() == "time (s)"
    part = run.plot("shaft_speed", window=(1.0, 2.0), title="start")
    assert (part.get_suptitle(), part.axes[0].get_xlim()) == ("start", (1.0, 2.0))
    axes = Figure().subplots()
    run.plot("shaft_speed", ax=axes, label="as it is")
    Drive.preset("hoist").scale(Z10=1.2).simulate(TESTS[0]).plot(ax=axes, label="faster")
    assert [each.get_label() for each in axes.lines] == ["as it is", "faster"]
    legend = axes.get_legend()
    assert legend is not None
    assert [each.get_text() for each in legend.get_texts()] == ["as it is", "faster"]
    colors = [each.get_color() for each in legend.get_lines()]
    assert colors == [each.get_color() for each in axes.lines]
    bare = Figure().subplots()
    run.plot("shaft_speed", ax=bare)
    assert bare.get_legend() is None
    assert np.allclose(axes.lines[0].get_ydata(), np.degrees(run.shaft_speed))
    with pytest.raises(InputError, match="1 axes .* 2 signals"):
        run.plot(["current", "shaft_speed"], ax=axes)


@pytest.mark.slow
def test_summaries_and_tables_of_a_notebook(work: Work) -> None:
    said = work.fitted.summary()
    for words in ("Search: ", "Estimates", "lower 95 %", "Fixed at their nominal values: V_dz"):
        assert words in said
    assert f"{work.fitted.drive['Z10'].value:.4f}"[:5] in said
    html = work.fitted._repr_html_()
    assert html is not None
    assert html.count("<table>") == len(work.fitted.tables()) == 3
    assert "<li>Fixed at their nominal values: V_dz" in html
    assert "step +4 V" in work.campaign.summary()
    assert "V_dz" in Drive.preset("hoist").summary()
    run = work.campaign.experiments[0]
    assert "encoder_counts" in run.summary()
    frame = run.to_polars()
    assert frame["signal"].unique(maintain_order=True).to_list() == ["input", *run.channels]
    assert frame.height == run.input.time.size + sum(c.time.size for c in run.channels.values())
    assert isinstance(run.plot(), Figure)
    assert isinstance(work.campaign.plot()[0], Figure)


def test_a_verdict_is_the_first_that_is_read(work: Work) -> None:
    verdict = work.judged.verdict
    assert verdict.headline.startswith("Usable: " if verdict.usable else "Not usable")
    answers = verdict.answers()
    assert list(answers)[:3] == ["Data", "Prediction", "Values"]
    said = "\n".join(f"{name}: {answer}" for name, answer in answers.items())
    for result in (verdict, work.judged):
        assert result.summary().startswith(
            f"{verdict.headline}\n\n{said}\n\n- {verdict.validity}\n"
        )
        html = result._repr_html_()
        assert html is not None
        assert html.startswith(f"<p><strong>{escape(verdict.headline)}</strong></p>")
        assert all(f"<dd>{escape(answer)}</dd>" in html for answer in answers.values())
        assert html.count(escape(verdict.headline)) == 1
        assert len(repr(result)) <= LONGEST + 40
    # numbers that matter, estimates, then how far predictions may be off; what they rest on can be
    # opened
    before, _, after = html.partition("<details>")
    numbers = work.judged.key_numbers
    assert numbers is not None
    assert before.index(numbers.table()._repr_html_()) < before.index("Estimates")
    assert str(numbers.table()) in work.judged.summary()
    assert work.fitted.problem.unknowns.names[0] in before
    stated = before.index(verdict.table().title)
    assert before.index("Estimates") < stated
    assert "Search: " in after
    assert [each.channel for each in verdict.predictions] == ["current", "counts"]
    assert all(before.index(f"{each.signal}</td>") > stated for each in verdict.predictions)
    assert "The tests determine all 6 free parameters" in after
    assert "held-out runs" not in html  # there are none
    # the free zeros of the runs' counts are in no table for people
    zeros = [name for name in work.judged if name.startswith("offset")]
    assert f"{len(zeros)} numbers of single runs, such as {zeros[0]}" in before
    assert set(zeros) <= set(work.judged.to_polars()["parameter"])


@pytest.mark.slow
def test_profiles_show_tables(work: Work) -> None:
    result = swashplate.identify(work.campaign, Drive.preset("hoist"), FEW, profiles=["Z10"])
    assert "Profile likelihoods" in result.summary()
    (profile,) = result.profiles
    assert "Profile likelihood of Z10" in profile.summary()
    (table,) = profile.tables()
    values, _, rises = (column.to_list() for column in table.to_polars())
    # the profile's ends are among its points, and its least cost is at the estimate
    assert values == sorted(values)
    assert values[0] < result["Z10"].value < values[-1]
    assert min(rises) == 0.0
    assert values[rises.index(0.0)] == pytest.approx(result["Z10"].value, rel=1e-3)


def test_a_run_says_what_the_command_prints() -> None:
    run = Drive.preset("hoist").simulate(maneuvers.parse("step:9"))
    printed = CliRunner().invoke(app, ["simulate", "hoist", "step:9"]).stdout
    rows = [" ".join(line.split()) for line in printed.splitlines()]
    summary = [" ".join(line.split()) for line in run.summary().splitlines()]
    numbers = [line for line in summary if re.search(r"\d|never", line)][1:]
    assert len(numbers) == 7 + len(Limit)
    assert all(any(row.startswith(line) for row in rows) for line in numbers)
    assert f"peak speed, positive {np.degrees(run.shaft_speed.max()):.2f} deg/s" in summary
    html = run._repr_html_()
    assert html is not None
    assert html.count("<table>") == 2
    assert "swash stop" in html


def test_a_full_order_run_shows_the_range_of_each_signal() -> None:
    run = FullOrderDrive.preset("hoist").simulate(TESTS[0])
    lines = {line.split("  ")[0]: line for line in run.summary().splitlines()}
    top = f"{np.degrees(run.shaft_speed.max()):.4g}"
    assert top in lines["shaft speed"]
    assert "deg/s" in lines["shaft speed"]
    assert isinstance(run.plot(), Figure)


def test_analyses_show_their_tables_and_figures() -> None:
    found = analyses(Drive.preset("hoist"))
    assert all(each.summary().count("\n") > 2 for each in found)
    drawn = [each for each in found if hasattr(each, "plot")]
    assert len(drawn) == len(found) - 1
    assert all(isinstance(each.plot(), Figure) for each in drawn)


@pytest.mark.slow
def test_only_what_can_be_drawn_has_a_plot(work: Work) -> None:
    hoist = Drive.preset("hoist")
    linear = hoist.linearize(4.0)
    undrawn = [
        hoist,
        hoist.parameters,
        hoist["Z16"],
        SquaredError(TESTS[0].sample()),
        linear,
        work.fitted,
        work.judged,
        work.judged.verdict,
        size(hoist, Requirements(speed=3.5), {"pump": (1.0, 2.0)}),
    ]
    assert [each for each in undrawn if hasattr(each, "plot")] == []
    assert "Z16" in hoist["Z16"].summary()
    assert "steady gain" in linear.summary()
    assert isinstance(TESTS[0].plot(), Figure)
    assert isinstance(work.campaign.experiments[0]["current"].plot(), Figure)
    assert isinstance(work.fitted.qualities[0].plot(), Figure)


def test_a_prediction_shows_what_the_verdict_judges(work: Work) -> None:
    hoist = Drive.preset("hoist").scale(Z16=1.2)
    qualities = predict(hoist, work.campaign.experiments)
    counts = next(each for each in qualities if each.channel == "counts")
    position, speed, residual = counts.plot().axes
    labels = [ax.get_ylabel() for ax in (position, speed, residual)]
    assert labels == ["angle (deg)", "shaft speed (deg/s)", "residual (deg/s)"]

    def curves(ax: Axes) -> list[Any]:
        return [each.get_ydata() for each in ax.lines if len(each.get_xdata()) > 2]

    measured, simulated = curves(speed)
    (difference,) = curves(residual)
    assert np.allclose(difference, simulated - measured, atol=1e-9)
    # at the end of the plateau the filters' delay does not count
    plateau = hoist.simulate(TESTS[0])
    steady = np.degrees(np.interp(2.9, plateau.time, plateau["shaft_speed"]))
    time = speed.lines[-1].get_xdata()
    assert np.interp(2.9, time, simulated) == pytest.approx(steady, rel=1e-2)
    current = next(each for each in qualities if each.channel == "current")
    assert [ax.get_ylabel() for ax in current.plot(window=(1.0, 2.0)).axes] == [
        "rectified current (A)",
        "residual (mA)",
    ]


def test_a_frequency_response_is_shown_in_units_of_people() -> None:
    response = Drive.preset("hoist").frequency_response(np.geomspace(0.1, 1.0, 20), [2.0, 1e-3])
    first = next(line for line in response.summary().splitlines() if line.strip().startswith("2 "))
    amplitude, frequency, gain, phase, distortion, _ = first.split()
    assert (float(amplitude), float(frequency)) == (2.0, 0.1)
    assert float(gain) == pytest.approx(np.degrees(response.gain[0, 0]), rel=1e-3)
    assert float(phase) == pytest.approx(np.degrees(response.phase[0, 0]), abs=0.05)
    assert float(distortion) == pytest.approx(100.0 * response.distortion[0, 0], abs=0.05)
    assert response.summary().count("no motion") == 8
    assert "8 of 20 frequencies shown" in response.summary()


def test_a_comparison_of_models_shows_their_difference() -> None:
    five = FullOrderDrive.preset("hoist")
    found = compare(five, five.drive.simulate(TESTS[0]))
    lines = {line.split("  ")[0]: line.split() for line in found.summary().splitlines()}
    assert float(lines["largest difference"][2]) == pytest.approx(
        np.degrees(np.abs(found.error).max()), rel=1e-3
    )
    assert float(lines["largest difference"][4]) == pytest.approx(
        100.0 * found.relative[0], abs=0.005
    )


def axes(count: int) -> list[Any]:
    return list(Figure().subplots(count, 1, squeeze=False)[:, 0])


@pytest.mark.parametrize(("count", "good"), [(1, False), (2, True), (3, True), (4, False)])
def test_a_bode_plot_takes_axes_for_gain_and_phase(count: int, good: bool) -> None:
    response = Drive.preset("hoist").frequency_response([0.1, 0.3, 1.0], [2.0, 4.0])
    given = axes(count)
    if not good:
        with pytest.raises(InputError, match=f"{count} axes"):
            response.plot(ax=given)
        return
    assert response.plot(ax=given) is given
    assert [len(ax.lines) >= 2 for ax in given] == [True] * count
    gain, phase = given[:2]
    assert np.allclose(gain.lines[0].get_ydata(), np.degrees(response.gain[0]))
    assert np.allclose(phase.lines[0].get_ydata(), np.degrees(response.phase[0]))


@pytest.mark.slow
def test_figures_of_one_panel_draw_in_given_axes() -> None:
    whole, _, _, _, inverse, tornado = analyses(Drive.preset("hoist"))
    for result in (whole, inverse, TESTS[0]):
        (ax,) = axes(1)
        assert result.plot(ax=ax, title="as measured") is ax
        assert ax.get_title(loc="left") == "as measured"
        assert ax.lines
    with pytest.raises(InputError, match="2 axes .* 1 panel"):
        whole.plot(ax=axes(2))
    both = axes(2)
    assert inverse.plot(ax=both) is both
    narrow, wide = (np.ptp(both[k].get_xlim()) for k in (1, 0))
    assert narrow < 0.5 * wide
    with pytest.raises(InputError, match="3 axes .* 2 panels"):
        inverse.plot(ax=axes(3))
    two = axes(2)
    assert tornado.plot(ax=two) is two
    assert [ax.get_xlabel() for ax in two] == ["final speed (deg/s)", "rise time (s)"]
    with pytest.raises(InputError, match="1 axes .* 2 outcomes"):
        tornado.plot(ax=axes(1))


def test_a_drive_stands_where_a_set_does(work: Work) -> None:
    hoist = Drive.preset("hoist")
    runs = work.campaign.select(role="fit")
    by_drive, by_set = predict(hoist, runs), predict(hoist.parameters, runs)
    assert np.array_equal(by_drive[0].simulated, by_set[0].simulated)


@pytest.mark.parametrize(
    "package", [each.name for each in pkgutil.iter_modules(swashplate.__path__) if each.ispkg]
)
def test_dir_of_a_package_shows_what_is_public(package: str) -> None:
    module = importlib.import_module(f"swashplate.{package}")
    named = [name for name in public_classes() if name.startswith(f"swashplate.{package}.")]
    assert {name.split(".")[2] for name in named} <= set(dir(module))
