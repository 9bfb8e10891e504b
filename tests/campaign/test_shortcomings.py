"""What a campaign lacks to be held against a drive."""

from collections.abc import Callable
from pathlib import Path

from swashplate import Campaign
from swashplate.campaign import beyond_the_card, campaign_findings

Edit = Callable[..., Path]


def test_a_campaign_that_lacks_nothing(campaign_folder: Path) -> None:
    tests = Campaign.from_toml(campaign_folder / "campaign.toml")
    assert campaign_findings(tests) == ()
    assert [beyond_the_card(each) for each in tests] == [(), ()]


def test_no_channel_measures_the_motion(campaign_folder: Path) -> None:
    path = campaign_folder / "campaign.toml"
    head, _, rest = path.read_text("utf-8").partition("[axes.winch.channels.counts]")
    path.write_text(head + rest[rest.index("[[runs]]") :], "utf-8")
    (said,) = campaign_findings(Campaign.from_toml(path))
    assert said.startswith("axis 'winch': no channel measures its motion")


def test_a_command_beyond_the_card(edited: Edit) -> None:
    """Written as 4 V, -4 V and meant as three times that."""
    path = edited('unit = "mV" }', 'unit = "mV", scale = 3.0 }')
    (up,), (down,) = (beyond_the_card(each) for each in Campaign.from_toml(path))
    assert "up.csv: column 'joystick': the voltage is 12 V at 0.5 s, but the card takes" in up
    assert "the voltage is -12 V" in down
    assert "[axes.winch.input]" in down
