"""The modules of this folder, which belong to no package, and what of the net runs by default."""

import os
import sys
from pathlib import Path

import pytest

HERE = str(Path(__file__).parent)
if HERE not in sys.path:
    sys.path.insert(0, HERE)
ALWAYS = (
    "hoist: simulate, default]",
    "hoist: simulate, split]",
    "hoist: simulate, symmetric]",
    "slew: simulate, default]",
    "luff: simulate, default]",
    "hoist: simulate_current, default]",
    "hoist: sensitivities, default]",
)
"""Ends of the names that run with every `make test`; the others compile a march each (`make
golden`)."""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """One process runs all of them: each would have to load every kernel."""
    left_out = []
    for item in items:
        if not str(item.path).startswith(HERE):
            continue
        item.add_marker(pytest.mark.xdist_group("golden"))
        named = item.name.startswith("test_case[")
        if named and not os.environ.get("GOLDEN") and not item.name.endswith(ALWAYS):
            left_out.append(item)
    if left_out:
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in left_out]
