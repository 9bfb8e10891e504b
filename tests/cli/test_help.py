"""Help texts fit a terminal of 80 columns."""

import inspect

import pytest

from swashplate.cli import app, campaign

COMMANDS = [*app.registered_commands, *campaign.app.registered_commands]


@pytest.mark.parametrize("command", COMMANDS, ids=lambda each: str(each.name))
def test_no_line_is_broken_in_mid_sentence(command):
    """Lines are kept as they are written, and a line has 78 characters between its margins."""
    assert max(map(len, inspect.getdoc(command.callback).splitlines())) <= 78
