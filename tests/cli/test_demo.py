import re
from pathlib import Path

import pytest

from swashplate import Drive


@pytest.mark.slow
def test_the_main_job(done, tmp_path):
    printed = done("demo", "--out", "sub/demo")
    folder = tmp_path / "sub/demo"
    assert len(list((folder / "virtual").glob("*.csv"))) == 13
    assert (folder / "report.html").stat().st_size < 2_000_000
    fitted, truth = (
        Drive.from_toml(folder / name) for name in ("drive.toml", "virtual/truth/drive.toml")
    )
    for volts in (-6.5, -2.0, 2.0, 6.5):
        assert fitted.steady_speed(volts) == pytest.approx(truth.steady_speed(volts), rel=2e-3)
    inside, counted = map(int, re.search(r"for (\d+) of (\d+) parameters", printed).groups())
    assert counted > 30
    assert inside > 0.8 * counted
    for name in ("drive.toml", "estimates.csv", "report.html"):
        assert f"sub/demo/{name}" in printed
    check_readme(printed)


def check_readme(printed: str) -> None:
    """The README shows lines of this output, with all but the last digits of its numbers."""
    readme = (Path(__file__).parents[2] / "README.md").read_text("utf-8")
    (shown,) = re.findall(r"```text\n(parameter .*?)```", readme, re.DOTALL)
    lines = [line.split() for line in printed.splitlines()]
    for words in (line.split() for line in shown.splitlines()):
        if words != ["..."] and "─" not in words[0]:
            assert any(len(words) == len(each) and all(map(alike, words, each)) for each in lines)


def alike(shown: str, printed: str) -> bool:
    try:
        return float(printed) == pytest.approx(float(shown), rel=2e-3)
    except ValueError:
        return printed == shown
