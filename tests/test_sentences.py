"""All that the package says stands in one file that a person reviews."""

from pathlib import Path
from runpy import run_path

import pytest

TOOL = run_path(str(Path(__file__).parents[1] / "tools" / "sentences.py"))


def test_all_sentences_were_reviewed() -> None:
    """Tests of a message check what it must name; its wording stands here alone."""
    present = TOOL["sentences"]()
    reviewed = TOOL["REVIEWED"].read_text("utf-8")
    if present != reviewed:
        new = sorted(set(present.splitlines()) - set(reviewed.splitlines()))
        pytest.fail(
            "The package says other things than tests/golden/sentences.txt: read what is new, "
            "mend it, then write the file again with `make sentences`.\n" + "\n".join(new)
        )
