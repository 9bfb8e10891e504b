"""The live page: a drive in a browser, equal to the drive in Python."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path

import numpy as np
import pytest
from tests.identification.given import virtual

from swashplate import Drive, InputError
from swashplate.campaign import Campaign
from swashplate.identification import predict
from swashplate.identification.validation import with_speeds
from swashplate.maneuvers import parse
from swashplate.report.fit_report import write_live_page

ACTS = """<script>
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
  const made = { first: [...live.latest.signals.shaft_speed], before: live.latest.errors };
  made.channels = live.figure.showing.shown.map((each) => each.name);
  const acts = (bit) => acting.map((each) => (each & bit ? 1 : 0));
  made.limits = Object.fromEntries(limits.map(([bit, name]) => [name, acts(bit)]));
  act("Orifice", 0.75);
  made.factor = live.factors.get("orifice");
  made.moved = [...live.latest.signals.shaft_speed];
  made.errors = live.latest.errors;
  made.toml = document.getElementById("toml").textContent;
  document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "r", bubbles: true }));
  made.reset = [...live.latest.signals.shaft_speed];
  made.milliseconds = document.body.dataset.milliseconds;
  const textContent = JSON.stringify(made);
  document.body.append(Object.assign(document.createElement("pre"), { id: "made", textContent }));
}, 5);
</script></body>"""


def acted(page: Path, tmp_path: Path, browsed) -> dict:
    """What a browser makes of a page whose orifice slider is moved, and then reset."""
    tried = tmp_path / "tried.html"
    tried.write_text(page.read_text("utf-8").replace("</body>", ACTS), "utf-8")
    found = re.search(r'<pre id="made">(.*?)</pre>', browsed(tried, ""), re.DOTALL)
    assert found is not None
    return json.loads(html.unescape(found[1]))


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


@pytest.fixture(scope="module")
def tests(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """Virtual tests of the hoist."""
    maneuvers = [parse("step:6,length=6"), parse("sine:5,0.2,length=10")]
    return virtual(tmp_path_factory.mktemp("tests"), "hoist", maneuvers, seed=4)


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


def test_what_cannot_be_shown_is_refused(tests: Campaign, tmp_path: Path) -> None:
    drive, page = Drive.preset("hoist"), tmp_path / "live.html"
    with pytest.raises(InputError, match="needs the runs of a campaign, or a command"):
        write_live_page(drive, page)
    with pytest.raises(InputError, match="no axis 'slew'"):
        write_live_page(drive, page, campaign=tests, axis="slew")
    assert not page.exists()


def test_the_page_is_small_and_asks_for_nothing(tests: Campaign, tmp_path: Path) -> None:
    page = tmp_path / "live.html"
    write_live_page(Drive.preset("hoist"), page, command=parse("step:9"))
    text = page.read_text("utf-8")
    content = json.loads(re.search(r'id="live">(.*?)</script>', text)[1])
    assert len(text) - len(content["wasm"]) < 60_000
    for asks in (r"""(src|href)=["'](?!data:|#)""", r"url\(", r"fetch\(", "XMLHttp", r"import\("):
        assert not re.search(asks, text), asks
