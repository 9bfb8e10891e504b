"""The report of a fit: what stands in it is what was found, and it needs nothing but itself."""

from __future__ import annotations

import html
import json
import re
import zlib
from base64 import b64decode
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import polars as pl
import pytest
from tests.identification.given import virtual
from tests.report.conftest import injected, policy_of, with_script

from swashplate import (
    Campaign,
    Definition,
    Drive,
    FileError,
    InputError,
    Machine,
    Model,
    analysis,
    discretised,
    equation,
    maneuvers,
    simulate,
)
from swashplate.export import libraries
from swashplate.identification import (
    Fit,
    FitSetup,
    Identification,
    Profile,
    Solution,
    assess_fit,
    fit,
    predict,
    uncertainty_of,
    with_speeds,
)
from swashplate.identification.diagnostics.causes import Cause
from swashplate.identification.statistics.interval_ends import Point
from swashplate.maneuvers import parse
from swashplate.report.fit_report import (
    print_report,
    shown_runs,
    write_fit_report,
    write_live_page,
    write_machine_page,
    write_samples,
    write_validation_report,
)
from swashplate.report.fit_report.live import SPAN
from swashplate.report.fit_report.runs import packed_samples, run_data

HOSTILE = "</script><img src=x onerror=alert(1)>"


def within(low: float, high: float, **more: object) -> dict[str, object]:
    return {"relative": (low, high), "log": True, **more}


# omega stands at its upper bound, which lies below the truth
FREE = {
    "G1": within(0.5, 2.0),
    "omega": within(0.5, 1.1, tied=True),
    "Z10": within(0.8, 1.4),
}
SETUP = FitSetup.model_validate({"title": "three numbers", "free": FREE})


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """Three virtual runs of the hoist, the last held out."""
    commands = [maneuvers.step(4.0), maneuvers.ramp(1.0), maneuvers.step(-6.5)]
    truth = Drive.preset("hoist").replace(omega=(75.0, 80.0), G1=(0.051, 0.056))
    what = {"seed": 4, "truth": truth, "validate": ["step -6.5 V"]}
    return virtual(tmp_path_factory.mktemp("campaign"), "hoist", commands, **what)


@pytest.fixture(scope="module")
def fitted(campaign: Campaign) -> Fit:
    """A fit to the runs, a window of the first ignored."""
    first, *others = campaign.select(role="fit")
    current = first["current"]
    current = replace(current, weight=np.where(current.time < 0.5, 0.0, current.weight))
    channels, ignored = {**first.channels, "current": current}, (0.0, 0.5, "the dither starts")
    first = replace(first, channels=channels, ignored=(ignored,))
    return fit(campaign.drive("hoist").parameters, [first, *others], SETUP, threads=1)


@pytest.fixture(scope="module")
def judged(campaign: Campaign, fitted: Fit) -> Identification:
    """The fit with a profile, several starts and notes."""
    optimum = Point(0.0, 3.0, np.zeros(1))
    points = (Point(-0.1, 4.0, np.zeros(1)), optimum, Point(0.1, 4.5, np.zeros(1)))
    name, ends = fitted.problem.unknowns.names[0], ("crossed", "crossed")
    profile = Profile(0, 3.0, points, 1.0, -0.1, 0.08, ends, None, name)
    return Identification(campaign, fitted, profiles=[profile], notes=NOTES)


STARTS = tuple(
    Solution(np.zeros(1), cost, 10, number != 2, False, "done", number=number)
    for number, cost in enumerate((3.0, 3.0, 70.0, float("inf")))
)
HEADS = ("run", "parameter", "channel", "quantity")
NOTES = {"command": HOSTILE, "seed": "4"}


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, judged: Identification) -> Path:
    path = tmp_path_factory.mktemp("report") / "fit.html"
    write_fit_report(judged, path)
    return path


class Page(HTMLParser):
    """Tables by their class, each row a list of texts; scripts by id; every tag with attributes."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tables: dict[str, list[list[str]]] = {}
        self.scripts: dict[str, str] = {}
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words = ""
        self._table = self._script = ""
        self._cell: list[str] | None = None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag == "table":
            self._table = dict(attrs)["class"]
            self.tables.setdefault(self._table, [])
        elif tag == "tr":
            self.tables[self._table].append([])
        elif tag in ("td", "th"):
            self._cell = []
        elif tag in ("script", "style"):
            self._script = dict(attrs).get("id") or tag

    def handle_endtag(self, tag):
        if tag in ("td", "th") and self._cell is not None:
            self.tables[self._table][-1].append(" ".join("".join(self._cell).split()))
            self._cell = None
        elif tag in ("script", "style"):
            self._script = ""

    def handle_data(self, data):
        if self._script:
            self.scripts[self._script] = self.scripts.get(self._script, "") + data
            return
        self.words += data
        if self._cell is not None:
            self._cell.append(data)

    def rows(self, table: str) -> list[dict[str, str]]:
        """Rows of all tables of a class by the heads of their columns; sums of others left out."""
        found, head = [], []
        for row in self.tables[table]:
            if row[0] in HEADS or row[1] == "run":
                head = row
            elif row[0] != "all":
                # a symbol stands below its meaning
                found.append({**dict(zip(head, row, strict=True)), "name": row[0].split(" ")[-1]})
        return found


@pytest.fixture(scope="module")
def read(page: Path) -> Page:
    return Page(page.read_text("utf-8"))


@pytest.fixture
def write(tmp_path: Path, judged: Identification):
    """Write the report of the fit with other entries; what stands in it."""

    def written(truth=None, **entries) -> Page:
        write_fit_report(replace(judged, **entries), tmp_path / "fit.html", truth=truth)
        return Page((tmp_path / "fit.html").read_text("utf-8"))

    return written


def number(text: str) -> float:
    """A table's number: true minus, power of ten apart, unit behind."""
    plain_text = text.replace("−", "-").replace(",", "")
    found = re.match(r"(-?[\d.]+)(?: ·10(\S+))?", plain_text)
    assert found, text
    raised = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
    return float(found[1]) * 10.0 ** int((found[2] or "0").translate(raised))


@pytest.mark.slow
def test_estimates_and_intervals_are_those_of_the_fit(read: Page, judged: Identification) -> None:
    rows = {row["name"]: row for row in read.rows("parameters")}
    for estimate in uncertainty_of(judged.fit).estimates:
        if estimate.name.startswith("offset"):
            continue
        row = rows[estimate.name]
        assert number(row["estimate"]) == pytest.approx(estimate.value, rel=1e-3), row
        if estimate.lower is None:
            assert row["lower 95 %"] == row["status"] == estimate.status
            continue
        half = 0.5 * (estimate.upper - estimate.lower)
        for head, end in (("lower 95 %", estimate.lower), ("upper 95 %", estimate.upper)):
            assert number(row[head]) == pytest.approx(end, abs=0.06 * half)


def test_fixed_parameters_are_listed_and_free_ones_are_not(read: Page) -> None:
    fixed = {row["name"]: row for row in read.rows("held")}
    assert {"tau", "Z1", "Z18", "zeta_plus"} <= set(fixed)
    assert not set(fixed) & {"G1_plus", "G1_minus", "omega_plus", "omega_minus", "Z10"}
    assert fixed["Z12"]["reason, where known"] == "0: this effect is left out"
    assert fixed["Z14"]["reason, where known"] == "inactive: no test reaches it"
    # in the units that people read, the number with its unit
    stop = Drive.preset("hoist").parameters.numbers["Z14"]
    assert fixed["Z14"]["unit"] == "mm"
    assert number(fixed["Z14"]["value"]) == pytest.approx(1e3 * stop, rel=1e-4)


def test_rmse_and_fit_of_a_run_are_recomputed(read: Page, fitted: Fit) -> None:
    problem, vector = fitted.problem, fitted.solution.vector
    experiment = problem.experiments[0]
    channel = experiment["current"]
    counted = channel.time >= 0.5
    measured = channel.values[counted]
    difference = problem.outputs(vector, 0)["current"][counted] - measured
    rmse = float(np.sqrt(np.mean(difference**2)))
    fit_percent = 100.0 * (1.0 - rmse / float(np.std(measured)))
    keys = {"run": experiment.name, "channel": "current"}
    (row,) = (each for each in read.rows("agreement") if keys.items() <= each.items())
    assert float(row["fit %"]) == pytest.approx(fit_percent, abs=0.006)
    assert row["unit"] == "mA"
    assert number(row["RMSE"]) == pytest.approx(1e3 * rmse, rel=6e-3)


def test_initial_state_and_ignored_windows_stand_beside_every_fit_percent(read, page) -> None:
    rows = read.rows("agreement")
    assert all(row["start"] == "rest" for row in rows)
    assert any("the dither starts" in row["ignored"] for row in rows)
    beside = re.findall(r'<p class="measures">.*?</p>', page.read_text("utf-8"), re.DOTALL)
    assert len(beside) == len(rows)
    assert all("initial state rest" in each and "ignored:" in each for each in beside)


def unpacked(found: dict) -> np.ndarray:
    """Numbers of `runs.packed`, read as its docstring says."""
    planes = np.frombuffer(zlib.decompress(b64decode(found["code"])), np.uint8)
    number = (256.0 ** np.arange(4)) @ planes.reshape(4, found["size"])
    whole = np.where(number % 2, -(number + 1) / 2, number / 2)
    for _ in range(found["order"]):
        whole = np.cumsum(whole)
    return found["zero"] + found["step"] * whole


@pytest.mark.parametrize(
    ("values", "step"),
    [
        (np.sin(np.arange(3000) / 50.0), None),
        (np.random.default_rng(0).standard_cauchy(1000), 0.1),  # some take all four bytes
        (np.full(300, 7.0), None),
        (np.array([]), None),
    ],
)
def test_numbers_are_packed_to_half_a_step(values: np.ndarray, step: float | None) -> None:
    found = packed_samples(values, step)
    np.testing.assert_allclose(unpacked(found), values, rtol=1e-12, atol=0.5001 * found["step"])


def test_samples_of_a_run_are_in_the_page(read: Page, fitted: Fit) -> None:
    experiment = fitted.problem.experiments[0]
    channel = json.loads(read.scripts["samples-0"])["channels"][0]
    simulated, residual = map(unpacked, channel["signals"])
    np.testing.assert_allclose(unpacked(channel["time"]), experiment["current"].time, atol=2e-4)
    measured = simulated - channel["ratio"] * residual
    rms = float(np.sqrt(np.mean(residual**2)))
    error = measured - experiment["current"].values
    assert float(np.abs(error).max()) < rms / 16.0


def test_every_sample_can_be_had_as_a_table(tmp_path: Path, judged: Identification) -> None:
    path = tmp_path / "samples.parquet"
    write_samples(shown_runs(judged.fit, judged.predicted), path)
    table = pl.read_parquet(path)
    assert {*table["channel"]} == {"current", "counts", "speed from counts"}
    held = next(each for each in judged.predicted if each.channel == "current")
    own = table.filter(role="validate", run=held.experiment.name, channel="current")
    np.testing.assert_allclose(own["measured"], held.experiment["current"].values)
    np.testing.assert_allclose(own["simulated"], held.simulated)
    np.testing.assert_allclose(own["time"], held.experiment["current"].time)
    ignored = table.filter(role="fit", channel="current", weight=0.0)
    assert 0.0 < ignored["time"].max() < 0.5


def test_a_long_run_costs_few_bytes(judged: Identification) -> None:
    quality = next(each for each in judged.predicted if each.channel == "current")
    channel = quality.experiment[quality.channel]
    many = 40
    time = np.arange(many * channel.time.size) / 512.0
    values = np.tile(channel.values, many)
    spiked = 12345
    values[spiked] = 9.9
    channel = replace(channel, time=time, values=values, weight=np.ones(values.size))
    experiment = replace(quality.experiment, channels={quality.channel: channel})
    long = replace(quality, experiment=experiment, simulated=np.tile(quality.simulated, many))
    (run,) = shown_runs(None, [long])
    data = run_data(run)
    assert len(json.dumps(data)) < 1.0 * values.size
    simulated, residual = map(unpacked, data["channels"][0]["signals"])
    measured = simulated - data["channels"][0]["ratio"] * residual
    assert measured.max() == pytest.approx(9.9, abs=0.02)


def test_the_page_needs_no_network(read: Page) -> None:
    for tag, attributes in read.tags:
        for key in ("src", "href", "action", "data"):
            address = attributes.get(key) or ""
            assert address.startswith(("#", "data:")) or not address, (tag, key, address)
        assert tag not in ("object", "embed", "base")
        if tag == "iframe":  # the live page, within the report
            assert "WebAssembly" in (attributes["srcdoc"] or "")
        assert tag != "link" or attributes.get("rel") == "icon"
    assert "@import" not in read.scripts["style"]
    assert "url(" not in read.scripts["style"]


@pytest.mark.slow
def test_hostile_names_stay_text(write, campaign: Campaign) -> None:
    *others, last = campaign.experiments
    runs = (*others, replace(last, name=HOSTILE))
    named = replace(campaign, title=HOSTILE, experiments=runs)
    page = write(campaign=named, notes={HOSTILE: HOSTILE})
    assert HOSTILE in page.words
    assert not [tag for tag, of in page.tags if tag == "img" or "onerror" in of]


def test_the_panel_offers_first_what_was_fitted(read: Page) -> None:
    (panel,) = [a["srcdoc"] or "" for tag, a in read.tags if tag == "iframe"]
    values = json.loads(re.search(r'id="live">(.*?)</script>', panel)[1])["parameters"]
    assert {each["symbol"] for each in values if each["main"]} == {"G1", "Z10", "omega"}


@pytest.mark.slow
def test_truth_stands_beside_the_estimates(write, judged: Identification, read: Page) -> None:
    truth = Drive.preset("hoist").replace(omega=(75.0, 80.0), G1=(0.051, 0.056)).parameters
    page = write(truth=truth)
    assert "truth" not in read.rows("parameters")[0]
    rows = {row["name"]: row for row in page.rows("parameters")}
    assert number(rows["G1_plus"]["truth"]) == pytest.approx(0.051, rel=1e-4)
    estimates = uncertainty_of(judged.fit).estimates
    (estimate,) = [each for each in estimates if each.name == "G1_plus"]
    holds = estimate.lower <= 0.051 <= estimate.upper
    assert rows["G1_plus"]["holds"] == ("yes" if holds else "no")
    fixed = {row["name"]: row for row in page.rows("held")}
    assert number(fixed["Z4"]["truth"]) == pytest.approx(truth.numbers["Z4"], rel=1e-4)


@pytest.mark.slow
def test_a_creep_and_a_way_that_no_test_shows_say_so(campaign: Campaign) -> None:
    still = Drive.preset("hoist").replace(Z11=0.0, Z18=0.0)
    found = fit(still, campaign.select(role="fit"), SETUP)
    numbers = analysis.key_numbers(found)
    assert numbers["creep"].text() == "0 (not seen)"
    assert "±" in numbers["top_speed_plus"].text()
    assert numbers["top_speed_minus"].note == "not tested"


def test_the_first_screen_is_for_the_owner(read: Page, fitted: Fit, validated: Path) -> None:
    rows = {row["quantity"]: row for row in read.rows("numbers")}
    drive = fitted.drive
    top, dead_zone = rows["Top speed"], rows["Dead zone"]
    plus, minus = analysis.key_numbers(fitted).commands
    largest = max(float(run.input.values.max()) for run in fitted.runs)
    # no fitted run goes the other way
    assert plus == minus == pytest.approx(largest, abs=0.005)
    assert top["unit"] == "deg/s"
    for way, head in ((plus, "positive"), (-minus, "negative")):
        settled = np.degrees(drive.simulate(np.full(8192, way), 512.0).shaft_speed[-1])
        assert number(top[head]) == pytest.approx(settled, rel=2e-3)
        # no force acts at the edge of the dead zone, and one does beyond it
        volts = number(dead_zone[head])
        inside, outside = drive.steady_current(np.array([0.99 * volts, 1.01 * volts]))
        dead = drive.parameters.numbers["Z17"]
        assert abs(float(inside)) <= dead < abs(float(outside))
    assert "±" in dead_zone["positive"]
    # the hoist creeps, and Z10 was fitted
    assert "±" in rows["Creep at rest"]["positive"]
    # a drive alone has no intervals
    assert "±" not in Page(validated.read_text("utf-8")).rows("numbers")[0]["positive"]
    assert "The held-out run" in read.words
    assert "Change first:" in read.words


@pytest.mark.slow
def test_each_run_has_a_light_and_links(
    read: Page, write, campaign, judged: Identification
) -> None:
    rows = read.rows("overview")
    assert [row["role"] for row in rows] == ["fit", "fit", "validate"]
    assert rows[-1]["run"] == judged.predicted[0].experiment.name
    # one machine's logs; the run that is held out alone goes down, where nothing was fitted
    assert {row["why"] for row in rows}.isdisjoint({"not sound"})
    # a run that the drive cannot follow: it went the other way
    *others, last = campaign.experiments
    still = {k: replace(c, values=-c.values) for k, c in last.channels.items()}
    page = write(campaign=replace(campaign, experiments=(*others, replace(last, channels=still))))
    lights = [of["class"] for tag, of in page.tags if tag == "span" and of.get("role") == "img"]
    assert lights[0] == "light bad"  # of the verdict
    assert lights[-1] == "light bad"
    assert [row["why"] == "not sound" for row in page.rows("overview")] == [False, False, True]
    # why, and what to write, stand on the first screen
    assert f"Settle first: In {last.name} 'counts' moves opposite to the command" in page.words
    assert "sign = -1" in page.words.partition("Settle first: ")[2].splitlines()[0]
    targets = {of["id"] for _, of in page.tags if "id" in of}
    links = {of["href"] for tag, of in page.tags if tag == "a"}
    assert {"#run-0", "#run-1", "#run-2"} <= links
    assert all(each.removeprefix("#") in targets for each in links)


@pytest.mark.slow
def test_the_first_screen_says_what_would_explain_the_error(
    tmp_path: Path, judged: Identification
) -> None:
    late = Cause("tau", 0.02, 0.8, "tau is 0.04 s instead of the stated 0.02", "measure it")
    error, result = judged.verdict.error, replace(judged)
    assert error is not None
    found = replace(judged.verdict, causes=(late,), required=0.5 * error.worst.error)
    vars(result)["verdict"] = found
    write_fit_report(result, tmp_path / "fit.html")
    page = Page((tmp_path / "fit.html").read_text("utf-8"))
    said = "Error beyond noise: tau is 0.04 s instead of the stated 0.02, which would explain 80 %"
    assert said in page.words
    lights = [of["class"] for tag, of in page.tags if tag == "span" and of.get("role") == "img"]
    assert lights[0] == "light bad"
    assert found.headline in page.words.replace("\N{NO-BREAK SPACE}", " ")
    assert "Use the drive" not in page.words


@pytest.mark.slow
def test_starts_are_listed(write, fitted: Fit) -> None:
    page = write(fit=replace(fitted, starts=STARTS))
    assert "2 of 4 starts reached the best cost, 3." in page.words
    assert "1 left the model's domain" in page.words
    listed = [row[:2] for row in page.tables["starts"][1:]]
    assert listed == [["0", "1"], ["1", "1"], ["2", "23.33333"]]


@pytest.fixture(scope="module")
def validated(tmp_path_factory, campaign: Campaign, fitted: Fit) -> Path:
    path = tmp_path_factory.mktemp("report") / "validation.html"
    predicted = predict(fitted.parameters, campaign.experiments)
    write_validation_report(
        fitted.parameters, campaign, path, predicted, notes={"drive from": HOSTILE}
    )
    return path


def test_a_validation_has_no_fit(validated: Path, campaign: Campaign, fitted: Fit) -> None:
    page = Page(validated.read_text("utf-8"))
    assert HOSTILE not in validated.read_text("utf-8")
    assert set(page.tables) == {
        *("numbers", "overview", "agreement", "residuals", "errors", "data", "notes")
    }
    roles = {row["run"]: row["role"] for row in page.rows("agreement")}
    assert roles == {each.name: each.role for each in campaign}
    predicted = predict(fitted.parameters, campaign.experiments)
    assert assess_fit(None, predicted).headline in page.words.replace("\N{NO-BREAK SPACE}", " ")


@pytest.mark.slow
def test_a_page_that_cannot_be_written_leaves_the_old_one(tmp_path, write, judged) -> None:
    with pytest.raises(FileError, match=r"fit\.html"):
        write_fit_report(judged, tmp_path / "none" / "fit.html")
    (tmp_path / "fit.html").write_text("old")
    # whatever fails while the page is made
    beyond = Profile(99, 1.0, (), 1.0, None, None, ("open", "open"), None, "Z1")
    with pytest.raises(IndexError):
        write(profiles=[beyond])
    assert [each.read_text() for each in tmp_path.iterdir()] == ["old"]


ZOOM = """
addEventListener("load", () => {
  const stack = document.querySelector(".run .stack");
  const { left, width } = stack.getBoundingClientRect();
  const at = { clientX: left + 0.5 * width, bubbles: true };
  stack.dispatchEvent(new WheelEvent("wheel", { ...at, ctrlKey: true, deltaY: -1500 }));
  stack.dispatchEvent(new PointerEvent("pointermove", at));
  dispatchEvent(new Event("beforeprint"));
});
"""


@pytest.mark.slow
def test_the_page_renders_and_zooms_in_a_browser_without_errors(
    page: Path, validated: Path, tmp_path: Path, fitted: Fit, browsed
) -> None:
    assert browsed(validated).count('data-drawn="yes"') == 4
    zoomed = tmp_path / "zoomed.html"
    zoomed.write_text(with_script(page.read_text("utf-8"), ZOOM), "utf-8")
    made = browsed(zoomed)
    # 3 runs, and one of those held out, which is alone on the first screen
    assert made.count('data-drawn="yes"') == made.count('class="stack"') == 4
    assert "<details>" not in made  # on paper nothing stays folded
    # the values where the pointer is are those of the run
    said = re.search(r'class="readout">([\d.]+) s · .*? measured current (\S+) (m?A) ·', made)
    assert said is not None
    channel = fitted.problem.experiments[0]["current"]
    value = float(said[2].replace("−", "-")) * (1e-3 if said[3] == "mA" else 1.0)
    row = int(np.searchsorted(channel.time, float(said[1])))
    assert value == pytest.approx(float(channel.values[row]), abs=5e-4)
    # and the view is 1.002^1500, twenty times, as short
    ticks = [float(t) for t in re.findall(r'text-anchor="middle">([\d.]+)</text>', made)]
    assert len(ticks) > 4


@pytest.mark.slow
def test_nothing_runs_in_a_report_but_its_own_scripts(
    page: Path, validated: Path, tmp_path: Path, browsed
) -> None:
    assert injected(validated, tmp_path, browsed).count('data-drawn="yes"') == 4
    assert injected(page, tmp_path, browsed).count('data-drawn="yes"') == 4
    # of the live page within it, which is folded until somebody opens it
    opened = tmp_path / "opened.html"
    text = page.read_text("utf-8").replace('<details class="screen">', "<details open>")
    opened.write_text(with_script(text.replace('loading="lazy"', ""), FRAMED), "utf-8")
    assert 'data-framed="yes"' in browsed(opened)


FRAMED = """
const wait = setInterval(() => {
  const { contentDocument } = document.querySelector("iframe.live");
  if (contentDocument?.body?.dataset.ready !== "yes") return;
  clearInterval(wait);
  document.body.dataset.framed = "yes";
}, 5);
"""


@pytest.mark.slow
def test_nothing_runs_in_a_live_page_but_its_own_scripts(tmp_path: Path, browsed) -> None:
    page = tmp_path / "live.html"
    write_live_page(Drive.preset("hoist"), page, command=parse("step:9"))
    assert policy_of(page.read_text("utf-8"))["script-src"][-1] == "'wasm-unsafe-eval'"
    assert 'data-ready="yes"' in injected(page, tmp_path, browsed)


@pytest.mark.slow
def test_a_report_is_printed(page: Path, tmp_path: Path, browsed) -> None:
    printed = tmp_path / "fit.pdf"
    print_report(page, printed)
    content = printed.read_bytes()
    assert content.startswith(b"%PDF")
    assert len(re.findall(rb"/Type /Page\b", content)) >= 5
    with pytest.raises(FileError, match=r"'\.txt'.* \.pdf"):
        print_report(page, tmp_path / "fit.txt")


# --- the live page --------------------------------------------------------------------------------


ACTS = """
const act = (words, value) => {
  const range = document.querySelector(`input[type=range][aria-label="${words}"]`);
  range.value = value;
  range.dispatchEvent(new Event("input"));
};
const wait = setInterval(() => {
  if (document.body.dataset.ready !== "yes") return;
  clearInterval(wait);
  const acting = [...live.latest.limits];
  const { limits } = JSON.parse(document.getElementById("live").textContent);
  const made = { first: [...live.latest.seen.at(-1)], before: live.latest.errors };
  made.channels = live.figure.showing.run.shown.map(({ name }) => name);
  const acts = (bit) => acting.map((each) => (each & bit ? 1 : 0));
  made.limits = Object.fromEntries(limits.map(([bit, name]) => [name, acts(bit)]));
  act("LEVER"[0].toUpperCase() + "LEVER".slice(1), 0.75);
  made.factor = live.factors.get("LEVER");
  made.moved = [...live.latest.seen.at(-1)];
  made.errors = live.latest.errors;
  made.toml = document.getElementById("toml").textContent;
  document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "r", bubbles: true }));
  made.reset = [...live.latest.seen.at(-1)];
  made.milliseconds = document.body.dataset.milliseconds;
  const textContent = JSON.stringify(made);
  document.body.append(Object.assign(document.createElement("pre"), { id: "made", textContent }));
}, 5);
"""


def acted(page: Path, tmp_path: Path, browsed, lever: str = "orifice") -> dict:
    """What a browser makes of a page of which one lever's slider is moved, and then reset."""
    tried = tmp_path / "tried.html"
    script = ACTS.replace("LEVER", lever)
    tried.write_text(with_script(page.read_text("utf-8"), script), "utf-8")
    found = re.search(r'<pre id="made">(.*?)</pre>', browsed(tried, ""), re.DOTALL)
    assert found is not None
    return json.loads(html.unescape(found[1]))


@pytest.mark.slow
def test_a_slider_gives_what_python_gives(tmp_path: Path, browsed) -> None:
    drive, command = Drive.preset("hoist"), parse("step:9")
    page = tmp_path / "live.html"
    write_live_page(drive, page, command=command)
    made = acted(page, tmp_path, browsed)
    # the page's voltages have four bytes each
    voltage = command.sample(512.0).astype(np.float32).astype(float)
    run = drive.simulate(voltage, 512.0)
    largest = np.abs(run.shaft_speed).max()
    np.testing.assert_allclose(made["first"], run.shaft_speed, rtol=0.0, atol=1e-12 * largest)
    for name, acts in made["limits"].items():
        assert acts == run.active(name.replace("-", "_")).astype(int).tolist(), name
    assert sum(made["limits"]["orifice"]) > 10
    moved = drive.scale(Z16=made["factor"]).simulate(voltage, 512.0).shaft_speed
    assert np.abs(moved - run.shaft_speed).max() > 0.01 * largest
    np.testing.assert_allclose(made["moved"], moved, rtol=0.0, atol=1e-12 * largest)
    assert made["reset"] == made["first"]
    changed = drive.scale(Z16=made["factor"]).parameters["Z16"].values
    line = re.fullmatch(
        r'\[pump_motor\]\nZ16 = \{ value = \[(\S+), (\S+)\], unit = "m", status = "user" \}',
        made["toml"],
    )
    assert line is not None, made["toml"]
    np.testing.assert_allclose([float(line[1]), float(line[2])], changed, rtol=1e-15)


class Lag(NamedTuple):
    time_constant: Annotated[float, Definition("time constant", "s", above=0.0)]
    offset: float = 0.0


class Tank(NamedTuple):
    level: Annotated[float, Definition("level", "m")] = 0.0


class TankLimits(NamedTuple):
    low: Annotated[bool, Definition("below its </style> mark", "1")]
    high: bool


@equation
def filled(
    state: Tank, inflow: Annotated[float, Definition("inflow", "m/s")], leak: float, p: Lag
) -> Tank:
    return Tank((inflow - leak + p.offset - state.level) / p.time_constant)


@equation
def tank_limits(state: Tank) -> TankLimits:
    return TankLimits(state.level < 0.1, state.level > 2.0)


TANK = Machine(Model("tank", Lag, Tank, discretised(filled, "rk4"), limits=tank_limits), Lag(0.5))
MACHINE_ACTS = ACTS.replace(
    '"LEVER"[0].toUpperCase() + "LEVER".slice(1)', '"time_constant: time constant"'
)


@pytest.mark.slow
def test_a_page_runs_a_machine_of_its_user_s(tmp_path: Path, browsed, monkeypatch) -> None:
    if not libraries.has_zig():
        pytest.skip("ziglang is not installed")
    page, command = tmp_path / "tank.html", parse("step:3,stop=4,length=5")
    assert write_machine_page(TANK, page, {"inflow": command, "leak": 0.5}, 100.0) == ()
    monkeypatch.setitem(globals(), "ACTS", MACHINE_ACTS)
    made = acted(page, tmp_path, browsed)
    inflow = command.sample(100.0).astype(np.float32).astype(float)
    inputs = {"inflow": inflow, "leak": 0.5}
    run = simulate(TANK, inputs, 100.0)
    np.testing.assert_allclose(made["first"], run["level"], rtol=0.0, atol=1e-14)
    content = json.loads(re.search(r'id="live">(.*?)</script>', page.read_text("utf-8"))[1])
    assert content["runs"][0]["name"] == "inflow"  # a maneuver's own name is in volts
    assert made["limits"]["limit-0"] == run.active("low").astype(int).tolist()
    assert sum(made["limits"]["limit-1"]) > 10
    name, value = re.fullmatch(r"--set (\w+)=(\S+)", made["toml"]).groups()
    assert float(value) == pytest.approx(0.5 * SPAN**0.5)  # three quarters of the slider
    moved = simulate(TANK.replace({name: float(value)}), inputs, 100.0)
    np.testing.assert_allclose(made["moved"], moved["level"], rtol=0.0, atol=1e-14)
    assert made["reset"] == made["first"]


def test_a_machine_s_page_needs_a_command(tmp_path: Path) -> None:
    page = tmp_path / "tank.html"
    with pytest.raises(InputError, match="tank needs the signal 'leak'"):
        write_machine_page(TANK, page, {"inflow": parse("step:1")})
    with pytest.raises(InputError, match="one of the inputs must be a maneuver"):
        write_machine_page(TANK, page, {"inflow": 1.0, "leak": 0.5})
    with pytest.raises(InputError, match="no input 'outflow'"):
        write_machine_page(TANK, page, {"outflow": parse("step:1")})
    assert not page.exists()


@pytest.fixture(scope="module")
def tests(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """Virtual tests of the hoist."""
    maneuvers = [parse("step:6,length=6"), parse("sine:5,0.2,length=10")]
    return virtual(tmp_path_factory.mktemp("tests"), "hoist", maneuvers, seed=4)


@pytest.mark.slow
def test_errors_are_those_of_the_prediction(tests: Campaign, tmp_path: Path, browsed) -> None:
    page, drive = tmp_path / "live.html", Drive.preset("hoist").scale(Z10=1.02)
    assert write_live_page(drive, page, campaign=tests) == ()
    made = acted(page, tmp_path, browsed)
    found = {q.channel: q.measures for q in with_speeds(predict(drive, [tests[0]]))}
    shown = dict(zip(made["channels"], made["before"], strict=True))
    assert set(shown) == set(found) - {"counts"}
    for name, errors in shown.items():
        # what was measured is rounded to 1/65,535 of its range on the page
        assert errors["rmse"] == pytest.approx(found[name].rmse, rel=1e-3), name
        assert errors["fit"] == pytest.approx(found[name].fit_percent, abs=0.01), name
    assert made["errors"][-1]["rmse"] > 1.5 * made["before"][-1]["rmse"]


@pytest.mark.slow
def test_what_cannot_be_shown_is_refused(tests: Campaign, tmp_path: Path) -> None:
    drive, page = Drive.preset("hoist"), tmp_path / "live.html"
    with pytest.raises(InputError, match="campaign, or a command"):
        write_live_page(drive, page)
    with pytest.raises(InputError, match="axis 'slew'"):
        write_live_page(drive, page, campaign=tests, axis="slew")
    assert not page.exists()


@pytest.mark.slow
def test_a_lever_of_a_parameter_without_directions_counts_once(tmp_path: Path, browsed) -> None:
    drive, command, page = Drive.preset("hoist"), parse("step:9"), tmp_path / "live.html"
    write_live_page(drive, page, command=command)
    made = acted(page, tmp_path, browsed, "pump")
    voltage = command.sample(512.0).astype(np.float32).astype(float)
    moved = drive.scale(Z10=made["factor"]).simulate(voltage, 512.0).shaft_speed
    assert np.abs(moved - made["first"]).max() > 0.1
    np.testing.assert_allclose(made["moved"], moved, rtol=0.0, atol=1e-11)


@pytest.mark.slow
def test_the_page_is_small_and_asks_for_nothing(tests: Campaign, tmp_path: Path) -> None:
    page = tmp_path / "live.html"
    write_live_page(Drive.preset("hoist"), page, command=parse("step:9"))
    text = page.read_text("utf-8")
    content = json.loads(re.search(r'id="live">(.*?)</script>', text)[1])
    # of which 14,000 say what the scripts' functions do and take
    assert len(text) - len(content["wasm"]) < 80_000
    # each design variable moves each of its numbers once
    for variable in content["design_variables"]:
        numbers = [number for number, _ in variable["moves"]]
        assert len(set(numbers)) == len(numbers), variable["name"]
    for asks in (r"""(src|href)=["'](?!data:|#)""", r"url\(", r"fetch\(", "XMLHttp", r"import\("):
        assert not re.search(asks, text), asks
