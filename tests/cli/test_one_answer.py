"""One answer for the numbers that matter: whatever shows them shows the same text."""

import re
import tomllib
from collections.abc import Callable
from dataclasses import replace
from html import unescape
from pathlib import Path

import pytest
from tests.cli.conftest import freeing

from swashplate import Drive, analysis
from swashplate.cli import parsing
from swashplate.identification import Identification
from swashplate.parameters import LoggedCommand

Words = Callable[..., str]
LABELS = (
    "Dead zone",
    "Gain beyond it",
    "Jump there",
    "Top speed",
    "Acceleration",
    "Delay, to 2 %",
    "Lag, to 63 %",
    "Creep at rest",
)
TESTS = tuple(
    word
    for volts in (4, -5, 2.5, -1.5)
    for word in ("--maneuver", f"step:{volts},start=0.5,stop=2.5,length=4")
)
"""Four short tests, as options of 'rig'."""
SETUPS = {
    "with current": freeing("J omega_plus Z8 Z10 Z16"),
    "without current": freeing("Z10 Z16"),
    # the search may not go where the true orifice is
    "at a bound": freeing("J Z8") + "free.Z16 = { relative = [0.5, 1.02], log = true }\n",
}


def in_lines(printed: str) -> list[dict[str, list[str]]]:
    """Cells of each of the tables of numbers that a command printed, by their labels."""
    tables = list[dict[str, list[str]]]()
    for line in printed.splitlines():
        label = next((label for label in LABELS if line.strip().startswith(f"{label}  ")), None)
        if label is None:
            continue
        if label == LABELS[0]:
            tables.append({})
        tables[-1][label] = re.split(r"  +", line.strip())[1:]
    return tables


def in_page(page: str) -> list[dict[str, list[str]]]:
    """The same of each of the tables of numbers in HTML."""
    tables = list[dict[str, list[str]]]()
    for row in re.findall(r"<tr[^>]*>(.*?)</tr>", page, re.DOTALL):
        cells = [
            unescape(re.sub(r"<[^>]+>", "", cell)).replace("\N{MINUS SIGN}", "-").strip()
            for cell in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row, re.DOTALL)
        ]
        if cells[0] == LABELS[0]:
            tables.append({})
        if cells[0] in LABELS and tables:
            tables[-1][cells[0]] = [cell for cell in cells[1:] if cell]
    return tables


@pytest.fixture
def logs(done: Words, tmp_path: Path) -> Path:
    """Four steps of a hoist with other orifices and another jump."""
    truth = Drive.preset("hoist").replace(Z16=(1.3e-4, 1.3e-4), J=(0.26, 0.31))
    truth.to_toml(tmp_path / "truth.toml")
    done("rig", "truth.toml", "--out", "virtual", *TESTS)
    path = tmp_path / "virtual" / "campaign.toml"
    text = path.read_text("utf-8").replace('drive = "drive.toml"', 'drive = "hoist"')
    path.write_text(text, "utf-8")
    return path


def without_current(path: Path) -> None:
    """Delete the channel of the current."""
    text = path.read_text("utf-8")
    text, count = re.subn(r"\[axes\.\w+\.channels\.\w*current\w*\]\n(?:[^\[\n].*\n|\n)*", "", text)
    assert count
    path.write_text(text, "utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("case", SETUPS)
def test_every_output_shows_the_same_numbers(done, run, logs, tmp_path, case) -> None:
    (tmp_path / "setup.toml").write_text(SETUPS[case], "utf-8")
    if case == "without current":
        without_current(logs)
    fit = run("fit", str(logs), "--setup", "setup.toml", "--out", "fitted")
    assert fit.exit_code in (0, 1), fit.output
    (expected,) = in_lines(fit.stdout)
    assert [*expected] == [*LABELS]
    judged = Identification.load(tmp_path / "fitted")
    pages = {
        "report": (tmp_path / "fitted" / "report.html").read_text("utf-8"),
        "notebook": judged._repr_html_(),
    }
    done("live", "fitted", str(logs), "--out", "live.html")
    pages["live page"] = (tmp_path / "live.html").read_text("utf-8")
    shown = {name: in_page(page) for name, page in pages.items()}
    shown["limits"] = in_lines(done("limits", "fitted"))
    shown["validate"] = in_lines(
        run("validate", "fitted", str(logs), "--role", "all", "--out", "v").stdout
    )
    shown["validation"] = in_page((tmp_path / "v" / "report.html").read_text("utf-8"))
    shown["summary"] = in_lines(judged.summary())
    shown["compare"] = in_lines(done("compare", "fitted", "hoist"))[:1]
    assert shown == {name: [expected] for name in shown}
    # what limits it and what to change first, too
    first = judged.key_numbers.change_first
    words = f"Change first: {first.component}."
    for text in (pages["report"], pages["live page"], done("limits", "fitted"), fit.stdout):
        assert words in " ".join(unescape(text).split())
    # with an interval for each, whatever is at a bound
    for label, cells in expected.items():
        for cell in cells[:-1]:
            assert re.search(r"±| to |at least|at most|\(fixed\)|not seen", cell), (label, cell)


def test_a_guess_shows_the_numbers_of_its_drive(done, logs, tmp_path) -> None:
    shown = in_lines(done("guess", str(logs), "--out", "first"))
    assert shown == in_lines(done("limits", "first/start.toml"))
    (numbers,) = shown
    assert [*numbers] == [*LABELS]


def test_numbers_are_of_the_stick_s_own_volts(hoist: Drive) -> None:
    """A stick of ±5 V about 5 V, tested to 9 V: half of each command, twice the gain."""
    stick = LoggedCommand("Joystick", "", 2.0, -10.0)
    plain = replace(hoist.parameters, tested=(8.0, 6.0))
    numbers = analysis.key_numbers(Drive(replace(plain, command=stick)))
    card = analysis.key_numbers(Drive(plain))
    assert numbers.commands == (4.0, 3.0)
    for way in ("plus", "minus"):
        dead, gain = f"dead_zone_{way}", f"gain_{way}"
        assert numbers[dead].value == pytest.approx(0.5 * card[dead].value)
        assert numbers[gain].value == pytest.approx(2.0 * card[gain].value)
        assert numbers[f"lag_{way}"] == card[f"lag_{way}"]
    said = " ".join(numbers.sentences)
    assert "'Joystick'" in said
    assert "5 V at rest" in said
    assert "4 and -3 V" in said


def test_a_creep_that_may_be_none_is_in_no_table_of_a_controller(
    done, number, tmp_path, monkeypatch
) -> None:
    """The hoist creeps by 3.09 deg/s; what is not told from none is not compensated."""
    Drive.preset("hoist").to_toml(tmp_path / "winch.toml")
    numbers = analysis.key_numbers(Drive.preset("hoist"))
    creep = numbers["creep"]
    for half, taken in ((1.5, 0.0), (0.5, creep.value)):
        found = creep._replace(
            lower=creep.value * (1.0 - half), upper=creep.value * (1.0 + half), note=""
        )
        others = tuple(each for each in numbers.numbers if each.name != "creep")
        given = replace(numbers, numbers=(*others, found))
        monkeypatch.setattr(parsing, "key_numbers_of", lambda *_, given=given: given)
        said = done("compensate", "winch.toml", "--out", "map.toml", "--force")
        written = tomllib.loads((tmp_path / "map.toml").read_text("utf-8"))
        assert written["rest"]["speed"] == pytest.approx(taken, abs=1e-12)
        assert ("The map takes it as none" in said) == (half > 1.0)
    assert numbers["creep"].text() == f"{creep.value:.4g}"
