"""Differences of the refined march against the plain march's exact derivatives."""

import numpy as np
import pytest

from swashplate import Drive, maneuvers
from swashplate.campaign import rig
from swashplate.campaign.campaign import Campaign
from swashplate.identification.drive_model import DriveModel
from swashplate.identification.forces import Forces

CURRENTS = (0.06, 0.16, 0.28, 0.40)
VALUES = {"Z1": 4.7e-7, "Z16_plus": 1.2e-4, "G1_plus": 0.0495, "start_pressure": 2e4}


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    tests = rig.run(
        "hoist",
        [maneuvers.step(4.0)],
        severity="clean",
        channels=("shaft_speed", "position", "rectified_current", "swash_angle"),
    )
    return Campaign.from_toml(rig.write(tests, tmp_path_factory.mktemp("tests") / "virtual"))


def test_with_refinements_off_they_are_the_exact_derivatives(campaign: Campaign) -> None:
    (run,) = campaign.experiments
    drive, forces = Drive.preset("hoist").parameters, Forces(CURRENTS, CURRENTS)
    channels = [*run.channels]
    by_kind = {channel.kind: name for name, channel in run.channels.items()}
    offset = f"offset {by_kind['position']}"
    values = {
        **VALUES,
        "force_plus_2": forces.values(drive)["force_plus_2"],
        f"clock {by_kind['shaft_speed']}": 0.0013,
        offset: 0.1,
    }
    inner = [name for name in values if name != offset]
    plain = DriveModel(drive, forces=forces)
    # a load that nothing leaks under changes nothing, but takes the other way
    refined = DriveModel(drive, forces=forces, sizes={"load_torque": 1e4})
    by_steps = {**values, "load_torque": 0.0}
    exact = plain.linearise(values, run, inner)
    found = refined.linearise(by_steps, run, [*inner, "load_torque"])
    for name in channels:
        np.testing.assert_allclose(found[name].values, exact[name].values, atol=1e-12)
        np.testing.assert_array_equal(found[name].by[:, -1], 0.0)
        scale = np.abs(exact[name].by).max(axis=0) + 1e-300
        # a step across a switch of the card moves single samples
        error = np.abs(found[name].by[:, :-1] - exact[name].by) / scale
        assert np.quantile(error, 0.99) < 1e-4, name

    weights = {name: np.full(run[name].values.size, 2.0) for name in channels}
    names = [*inner, offset]
    R = plain.reduce(values, run, names, weights).triangle
    S = refined.reduce(by_steps, run, names, weights).triangle
    normal, by_normal = R.T @ R, S.T @ S
    size = np.sqrt(np.diag(normal))
    scaled = np.abs(by_normal - normal) / np.outer(size, size)
    assert scaled.max() < 1e-3
