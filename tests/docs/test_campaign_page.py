"""What docs/campaign.md shows is right: its file is valid, its Python runs, its lists are whole."""

import re
import tomllib
from pathlib import Path

import pytest

from swashplate.campaign import CHANNEL_KINDS, CampaignFile
from swashplate.logs import SUFFIXES

PAGE = (Path(__file__).parents[2] / "docs" / "campaign.md").read_text("utf-8")


def test_the_file_is_valid() -> None:
    (block,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    file = CampaignFile.model_validate(tomllib.loads(block))
    assert list(file.axes) == ["hoist"]
    assert file.runs[1].role == "validate"


def test_the_python_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (block,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(compile(block, "campaign.md", "exec"), {})
    assert capsys.readouterr().out.startswith("step +4 V")


def test_every_kind_and_ending_is_named() -> None:
    for kind in CHANNEL_KINDS:
        assert f"`{kind}`" in PAGE
    for suffix in SUFFIXES:
        assert re.search(rf"{re.escape(suffix)}\b", PAGE), suffix
