"""A short campaign of virtual tests."""

import pytest
from tests.identification.given import virtual

from swashplate import Campaign, Drive, maneuvers


@pytest.fixture(scope="session")
def short_campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """Three short steps up and one down, for a fit of `FEW`."""
    levels = (3.0, 4.0, 5.0, -4.0)
    commands = [maneuvers.step(level, start=0.5, stop=2.5, length=4.0) for level in levels]
    truth = Drive.preset("hoist").replace(J=(0.26, 0.31), Z10=13.0)
    clean = {"seed": 2, "truth": truth, "severity": "clean"}
    return virtual(tmp_path_factory.mktemp("rig"), "hoist", commands, **clean)
