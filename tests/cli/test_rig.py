from collections.abc import Callable
from pathlib import Path

from swashplate import Campaign, Drive

Words = Callable[..., str]
SHORT = ("--maneuver", "step:4,start=0.5,stop=1,length=2")


def test_a_virtual_campaign_can_be_checked(done: Words, tmp_path: Path) -> None:
    said = done("rig", "hoist", "--out", "virtual", *SHORT)
    assert "hoist_step_4_V.csv" in said.replace("+", "")
    tests = Campaign.from_toml(tmp_path / "virtual" / "campaign.toml")
    assert tests.virtual
    assert next(iter(tests)).maneuver == "step +4 V"
    assert "virtual" in done("campaign", "check", "virtual/campaign.toml")


def test_refinements_and_backlash_change_the_logs(done: Words, tmp_path: Path) -> None:
    done("rig", "slew", "--out", "a", "--severity", "clean", *SHORT)
    done("rig", "slew", "--out", "b", "--severity", "clean", "--backlash-deg", "0.1", *SHORT)
    done("rig", "slew", "--out", "c", "--severity", "clean", "--set", "cam_ripple=0.02", *SHORT)
    first, *others = (
        next(iter(Campaign.from_toml(tmp_path / name / "campaign.toml"))) for name in "abc"
    )
    for each in others:
        assert (first["counts"].values != each["counts"].values).any()
        assert (first["current"].values == each["current"].values).all()
    # a fit starts from the drive that was named, and only the truth has what was set
    nominal = Campaign.from_toml(tmp_path / "c" / "campaign.toml").drive("slew")
    assert nominal == Drive.preset("slew")
    truth = Drive.from_toml(tmp_path / "c" / "truth" / "drive.toml")
    assert truth.parameters.refinements == ("cam_ripple",)


def test_refusals(refused: Words, done: Words) -> None:
    assert "no parameter 'wobble'" in refused("rig", "hoist", "--out", "x", "--set", "wobble=1")
    assert "backlash must not" in refused("rig", "hoist", "--out", "x", "--backlash-deg", "-1")
    assert "no packaged set, file or folder 'crane'" in refused("rig", "crane", "--out", "x")
    done("rig", "slew", "--out", "y", *SHORT)
    assert "empty" in refused("rig", "slew", "--out", "y", *SHORT)
