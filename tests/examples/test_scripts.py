"""Examples as scripts print what their page shows, and are notebooks too."""

import re
from pathlib import Path

import jupytext
import pytest
from tests.shown import check_shown

from swashplate import Drive

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "examples.md").read_text("utf-8")
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
SCRIPTS = {"actuator", "eha", "excavator", "crane_gymnasium", "crane_mujoco"}
"""Which need data or packages that are not here; their first cell is code."""
each_example = pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)


@pytest.mark.parametrize(
    "name", ["simulate", "limits_of_a_crane", "controller", "identify_hoist", "joint_shaper", "tug"]
)
def test_an_example_prints_what_its_page_shows(run_example, name):
    made = run_example(name, "--figure", "figure.png")
    (said,) = re.findall(rf"examples/{name}\.py\n.*?```text\n(.*?)```", PAGE, re.DOTALL)
    check_shown(said, made.printed, name, share=0.0)  # but for what another processor may round
    assert (made.folder / "figure.png").stat().st_size > 20_000


def test_limits_of_a_set_of_ones_own(run_example, tmp_path):
    Drive.preset("slew").to_toml(tmp_path / "mine.toml")
    printed = run_example("limits_of_a_crane", str(tmp_path / "mine.toml")).printed
    first, *_ = printed.splitlines()
    assert re.findall(r"-?\d+\.?\d*", first)[1:4] == ["5.30", "4.2", "5.8"]
    assert "swash stop" in printed


@each_example
def test_to_a_notebook_and_back(path, tmp_path):
    book = jupytext.read(path)
    assert book.metadata["jupytext"]["text_representation"]["format_name"] == "percent"
    again, back = tmp_path / "example.ipynb", tmp_path / "back.py"
    jupytext.write(book, again)
    jupytext.write(jupytext.read(again), back, fmt="py:percent")
    assert [(each.cell_type, each.source) for each in jupytext.read(back).cells] == [
        (each.cell_type, each.source) for each in book.cells
    ]
    assert sum(each.cell_type == "code" for each in book.cells) >= 5


@each_example
def test_a_title_and_how_to_run_it(path):
    assert f".venv/bin/python examples/{path.name}" in path.read_text("utf-8")
    if path.stem not in SCRIPTS:
        first = jupytext.read(path).cells[0]
        assert first.cell_type == "markdown"
        assert first.source.startswith("# ")


# --- on packages that are not the project's own, where these are installed ------------------------


@pytest.mark.filterwarnings("ignore::UserWarning")  # the observations have no bounds
def test_gymnasium_environment_is_one_and_feedback_earns_more(run_example):
    pytest.importorskip("gymnasium", reason="the example needs gymnasium")
    from gymnasium.utils.env_checker import check_env

    made = run_example("crane_gymnasium")
    without, fed = (float(each) for each in re.findall(r"return (-[\d.]+)", made.printed))
    assert fed > without
    check_env(made.names["CraneEnv"](), skip_render_check=True)


def test_mujocos_equations_lead_the_load_along_the_same_path(run_example):
    pytest.importorskip("mujoco", reason="the example needs mujoco")
    made = run_example("crane_mujoco")
    apart = [float(each) for each in re.findall(r"at most ([\d.]+) mm", made.printed)]
    assert apart[0] < 0.3
    # second order: a quarter of the distance at twice the rate
    assert apart[0] / apart[1] == pytest.approx(4.0, rel=0.05)


def test_predictive_control_swings_least_and_within_its_step(run_example):
    pytest.importorskip("osqp", reason="the example needs osqp")
    printed = run_example("crane_mpc", "--seeds", "1", "--length", "80").printed
    swing = {
        name: [float(each) for each in re.findall(rf"{name} +([\d.]+) deg", printed)]
        for name in ("shaper", "clip", "predictive")
    }
    # in the rougher sea, where the drives cannot follow
    assert swing["predictive"][1] < min(swing["clip"][1], swing["shaper"][1])
    taken = [float(each) for each in re.findall(r"takes ([\d.]+) ms", printed)]
    assert max(taken) < 1000.0 * 100 / 512  # a step lasts 100 samples
