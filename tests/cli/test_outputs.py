"""A command that cannot write one of its files writes none of them, and says so at once."""

import pytest

WRONG = {
    "plot.gifx": "a figure is written as .png, .svg or .pdf",
    "no/such/plot.png": "cannot be written: folder no/such does not exist",
}
LEVER = ("--scale", "orifice=1.5")


@pytest.mark.parametrize("plot", WRONG)
@pytest.mark.parametrize(
    ("words", "out"),
    [
        (("simulate", "hoist", "step:9"), "run.csv"),
        (("limits", "hoist"), "envelope.csv"),
        (("limits", "hoist", "step:9"), "shares.csv"),
        (("whatif", "hoist", *LEVER), "larger.toml"),
        (("sensitivity", "hoist", "--lever", "pump"), "numbers.csv"),
        (("bode", "hoist", "--points", "2"), "bode.csv"),
        (("compensate", "hoist"), "inverse.toml"),
        (("compare", "hoist", "slew"), "both.csv"),
    ],
)
def test_nothing_is_written_beside_a_figure_that_cannot_be(refused, words, out, plot):
    assert WRONG[plot] in refused(*words, "--out", out, "--plot", plot)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("size", "hoist", "--speed-deg-s", "250", "--out", "no/a.toml"), "folder no does not"),
        (("linearize", "hoist", "--at", "4", "--out", "a.csv"), "written as .toml or .json"),
        (("compensate", "hoist", "--out", "a.xlsx"), "written as .toml, .csv or .parquet"),
        (("excitation", "none.toml", "--write", "no/a.toml"), "folder no does not exist"),
        (("excitation", "none.toml", "--out", "a.txt"), "written as .csv or .parquet"),
        (("campaign", "plot", "none.toml", "--out", "a.gif"), ".png, .svg or .pdf"),
        (("campaign", "init", "none.csv", "--out", "no/a.toml"), "folder no does not exist"),
    ],
)
def test_places_are_looked_at_before_anything_is_read_or_computed(refused, words, said):
    """None of the files that are named first is there: it is the place that is told of."""
    assert said in refused(*words)
