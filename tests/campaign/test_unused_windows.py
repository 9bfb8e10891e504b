"""Windows that no run takes are told of, with what there is; those that are taken are not."""

from collections.abc import Callable
from pathlib import Path

import pytest

from swashplate import Campaign, InputError
from swashplate.campaign import campaign_findings

Edit = Callable[..., Path]
GEAR = "gear_ratio = 2.0\n"


def sentences(path: Path) -> tuple[str, ...]:
    return campaign_findings(Campaign.from_toml(path))


def test_windows_that_are_taken(edited: Edit) -> None:
    """Records go from 0 to 1 s; a step of +4 V in one run, of -4 V in the other."""
    path = edited(
        GEAR,
        f'{GEAR}ignore = [{{ from = 0.9 }}, {{ maneuver = "step +*" }}]\n'
        "weights = [{ from = 0.2, to = 0.3, factor = 2.0 }]\n",
    )
    assert sentences(path) == ()


def test_a_misspelt_manoeuvre(edited: Edit) -> None:
    path = edited(GEAR, f'{GEAR}ignore = [{{ maneuver = "setp *" }}]\n')
    (said,) = sentences(path)
    assert said == (
        "axes.winch.channels.counts.ignore: no run has the manoeuvre 'setp *', so that its window "
        "does nothing; there are 'step +4 V', 'step -4 V'"
    )


def test_a_window_on_another_clock(edited: Edit) -> None:
    """Written in ms, as the log's stamps are."""
    path = edited(
        'drive = "hoist"', 'drive = "hoist"\nignore = [{ from = 100.0, to = 200.0, why = "x" }]'
    )
    (said,) = sentences(path)
    assert said.startswith("axes.winch.ignore: the window from 100 s to 200 s holds no sample of")
    assert said.endswith("any of 2 runs")


def test_a_window_of_one_run(edited: Edit) -> None:
    path = edited(
        'role = "validate"', 'role = "validate"\nweights = [{ from = 7.0, factor = 2.0 }]'
    )
    (said,) = sentences(path)
    assert said == (
        "run 2 (down.csv): weights: the window from 7 s to its end holds no sample of down, which "
        "goes from 0 to 1 s"
    )


def test_a_misspelt_channel_of_a_run(edited: Edit) -> None:
    path = edited('role = "validate"', 'role = "validate"\naxes.winch.channels.count.sign = 1')
    with pytest.raises(InputError, match="changes the channel 'count', but the axis has current"):
        Campaign.from_toml(path)
