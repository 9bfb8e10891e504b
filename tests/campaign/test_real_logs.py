"""Measured logs of other machines load as campaigns; they are not part of the project."""

from pathlib import Path

import numpy as np
import pytest

from swashplate import Campaign
from swashplate.campaign import examine

DATA = Path(__file__).parents[3] / "shared" / "data"
pytestmark = pytest.mark.skipif(
    not DATA.exists(), reason="the measured logs of other machines are not beside this checkout"
)

ACTUATOR = """
[axes.{axis}]
time = {{ column = "Time", unit = "s" }}
input = {{ kind = "other", column = "{name} Cmd", unit = "%", offset = {offset} }}
start = "steady"

[axes.{axis}.channels.position]
kind = "position"
column = "{name} Ms"
unit = "{unit}"
"""
# the neutral duties and units of these logs are data: some are in mm, some in cm
RUN = """
[[runs]]
file = "{path}"
role = "{role}"
axes.boom.channels.position.unit = "{unit}"
axes.stick.channels.position.unit = "{unit}"
axes.bucket.channels.position.unit = "{unit}"
axes.stick.input.offset = {stick}
"""


@pytest.fixture(scope="module")
def excavator(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    neutral = {"boom": -7.4745, "stick": -6.895, "bucket": -7.614}
    text = "".join(
        ACTUATOR.format(axis=axis, name=axis.capitalize(), offset=offset, unit="cm")
        for axis, offset in neutral.items()
    )
    for name, role, unit, stick in (
        ("manual_1021_mitch", "fit", "cm", -6.895),
        ("manual_mitch_1101_2333", "fit", "cm", -6.9645),
        ("manual_shyam_1102_1824", "validate", "cm", -6.9645),
        ("manual_ol_1010_2055", "validate", "mm", -6.895),
        ("steps_boom_0928_0829", "ignore", "mm", -6.895),
    ):
        path = (DATA / "excavator" / f"{name}.csv").as_posix()
        text += RUN.format(path=path, role=role, unit=unit, stick=stick)
    file = tmp_path_factory.mktemp("excavator") / "campaign.toml"
    file.write_text(text, "utf-8")
    return Campaign.from_toml(file)


def test_irregular_stamps_are_kept_as_they_are(excavator: Campaign) -> None:
    experiment = excavator["manual_1021_mitch boom"]
    first = np.array([0.00605297088623, 0.0761840343475])
    assert experiment.input.time[:2] == pytest.approx(first, abs=0.0)
    (drive, position) = examine(experiment)
    assert drive.stamps.rate == pytest.approx(19.7, abs=0.1)
    assert drive.stamps.jitter > 0.0
    assert position.stamps.gaps.size >= 0


def test_a_pause_in_the_log_is_found(tmp_path: Path) -> None:
    text = ACTUATOR.format(axis="boom", name="Boom", offset=-7.4745, unit="mm")
    log = (DATA / "excavator" / "steps_boom_0928_0829.csv").as_posix()
    (tmp_path / "campaign.toml").write_text(f'{text}\n[[runs]]\nfile = "{log}"\n', "utf-8")
    (drive, _) = examine(Campaign.from_toml(tmp_path / "campaign.toml")["steps_boom_0928_0829"])
    assert drive.stamps.longest > 0.9
    assert "gap" in drive.findings[0]


def test_people_at_a_joystick_are_no_maneuver(excavator: Campaign) -> None:
    for experiment in (*excavator.select(role="fit"), *excavator.select(role="validate")):
        assert experiment.maneuver == "unnamed motion"


def test_the_electro_hydrostatic_actuator(tmp_path: Path) -> None:
    log = DATA / "eha" / "exp_data_1_3.csv"
    (tmp_path / "campaign.toml").write_text(
        f"""
[axes.eha]
time = {{ column = "EXP_Time", unit = "s" }}
input = {{ kind = "other", column = "EXP_Speed", unit = "rpm" }}

[axes.eha.channels]
position = {{ kind = "position", column = "EXP_PosFb", unit = "mm" }}
pressure = {{ kind = "other", column = "EXP_Pressure_A", unit = "bar" }}
speed = {{ kind = "shaft_speed", column = "EXP_Velocity", unit = "mm/s" }}

[[runs]]
file = "{log.as_posix()}"
""",
        "utf-8",
    )
    experiment = Campaign.from_toml(tmp_path / "campaign.toml")["exp_data_1_3"]
    lines = log.read_text("utf-8").splitlines()
    last = lines[-1].split(";")
    assert experiment["position"].values.size == len(lines) - 1
    assert experiment["position"].values[-1] == pytest.approx(1e-3 * float(last[2]), rel=1e-12)
    assert (experiment["position"].unit, experiment["speed"].unit) == ("m", "m/s")
    assert experiment["pressure"].unit == "bar"
