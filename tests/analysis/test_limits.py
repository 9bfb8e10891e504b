"""Each limit's share: drives with a single one, and the axes of Kruse (2001)."""

import numpy as np
import polars as pl
import pytest

from swashplate import DomainError, Drive, InputError, Limit, maneuvers
from swashplate.analysis import LimitShares, limit_shares

SINE = maneuvers.sine(9.0, 0.1).sample()


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.fixture(scope="module")
def shares(hoist: Drive) -> LimitShares:
    return limit_shares(hoist, SINE)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("limit", "changes"),
    [
        ("dead zone", {"V_dz": 0.5}),
        ("dead zone", {"Z17": 0.5}),
        ("current rate", {"lim1": 0.06, "lim2": 0.06, "I_t1": 1e-5}),
        ("final decay", {"I_t2": 5.0, "a": 2.0, "I_t1": 6.0}),
        ("delay", {"tau": 0.3}),
        ("orifice", {"Z16": 2e-5}),
        ("spool stop", {"Z14": 2e-5}),
        ("swash stop", {"Z13": 5e-4}),
        ("relief valve", {"Z15": 5.0}),
        ("spool offset", {"Z18": 1e-4}),
    ],
)
def test_a_single_limit_has_all_of_the_error(limit: str, changes: dict[str, float]) -> None:
    ideal = Drive.preset("neutral")
    # limits so tight that nobody would state them
    drive = Drive(ideal.parameters.with_numbers(changes))
    found = limit_shares(drive, SINE)
    first = found.first
    assert first is not None, found.shares
    assert first.limit == limit
    assert first.error == pytest.approx(0.0, abs=1e-12)
    assert first.error_share == pytest.approx(1.0)
    assert first.error_as_only_limit == pytest.approx(found.error, rel=1e-12)
    # independently: the ideal drive itself is the one without limits
    expected = drive.simulate(SINE).shaft_speed - ideal.simulate(SINE).shaft_speed
    assert found.error == pytest.approx(rms(expected), rel=1e-9)


def test_a_prime_mover_that_droops_has_all_of_the_error() -> None:
    drive, speed = Drive.preset("neutral"), 1.0 - 0.2 * (np.abs(SINE) > 5.0)
    found = limit_shares(drive, SINE, pump_speed=speed)
    assert found.first is not None
    assert found.first.limit == "pump speed"
    assert found.first.error == pytest.approx(0.0, abs=1e-12)
    drooping = drive.simulate(SINE, pump_speed=speed).shaft_speed
    assert found.error == pytest.approx(rms(drooping - drive.simulate(SINE).shaft_speed), rel=1e-9)
    assert found.error > 0.01


@pytest.mark.parametrize(
    ("name", "command", "limit"),
    [
        ("hoist", "sine:9,0.1", "swash stop"),
        ("hoist", "step:9", "orifice"),
        ("hoist", "sine:1,0.3", "dead zone"),
        ("luff", "sine:9,0.1", "orifice"),
        ("neutral", "sine:9,0.1", None),
    ],
)
def test_what_to_change_first(name: str, command: str, limit: str | None) -> None:
    found = limit_shares(Drive.preset(name), maneuvers.parse(command).sample())
    assert (found.first and found.first.limit) == limit
    assert (found.error == 0.0) == (limit is None)
    assert found.shares == tuple(sorted(found.shares, key=lambda share: share.error))


def test_shares_are_what_a_changed_drive_gains(hoist: Drive, shares: LimitShares, tmp_path) -> None:
    by, inf = {share.limit: share for share in shares.shares}, np.inf
    ideal = hoist.replace(V_dz=0.0, Z17=hoist["J"].value.plus, lim1=inf, lim2=inf, I_t2=0.0)
    ideal = ideal.replace(tau=0.0, Z16=inf, Z14=inf, Z15=inf, Z18=0.0)
    ideal = ideal.replace(Z13=by["swash stop"].changes["Z13_plus"])
    reference = ideal.simulate(SINE).shaft_speed
    np.testing.assert_array_equal(shares.reference, reference)
    run = hoist.simulate(SINE)
    error = rms(run.shaft_speed - reference)
    assert shares.error == pytest.approx(error, rel=1e-12)
    without = rms(hoist.replace(tau=0.0).simulate(SINE).shaft_speed - reference)
    assert by["delay"].error == pytest.approx(without, rel=1e-12)
    assert by["delay"].error_share == pytest.approx(1.0 - without / error, rel=1e-9)
    only = ideal.replace(tau=0.014).simulate(SINE).shaft_speed - reference
    assert by["delay"].error_as_only_limit == pytest.approx(rms(only), rel=1e-12)
    # shares of time
    assert by["swash stop"].time_share == run.active(Limit.SWASH_STOP).mean()
    assert by["delay"].time_share is None
    asked = run.active(Limit.DEAD_ZONE) & (SINE != 0.0)  # at rest nobody misses anything
    assert by["dead zone"].time_share == asked.mean() < run.active(Limit.DEAD_ZONE).mean()
    shares.write(tmp_path / "shares.csv")
    table = pl.read_csv(tmp_path / "shares.csv")
    assert table["limit"][0] == "swash stop"
    assert table["error"][0] == pytest.approx(shares.shares[0].error)


def test_a_speed_that_was_reference_and_a_load(hoist: Drive) -> None:
    leaking = hoist.replace(motor_leakage=1e-6)
    run = leaking.simulate(SINE, load_torque=3e4).shaft_speed
    assert limit_shares(leaking, SINE, load_torque=3e4, reference=run).error == 0.0
    found = limit_shares(leaking, SINE, load_torque=3e4, reference=np.zeros(SINE.size))
    assert found.error == pytest.approx(rms(run))
    assert "against the reference speed" in found.sentences()[0]
    assert "against a drive without limits" in limit_shares(hoist, SINE).sentences()[0]
    (delay,) = (each for each in found.shares if each.limit == "delay")
    without = leaking.replace(tau=0.0).simulate(SINE, load_torque=3e4).shaft_speed
    assert delay.error == pytest.approx(rms(without), rel=1e-12)
    with pytest.raises(InputError, match=r"reference speed .* \d+ finite numbers"):
        limit_shares(hoist, SINE, reference=np.zeros(3))


def test_a_machine_that_was_guessed_need_not_have_an_orifice() -> None:
    (said,) = limit_shares(Drive.preset("neutral").replace(Z16=2e-5), SINE).sentences()
    assert said.startswith("Change first: limit of the acceleration, modelled as an in-line")


def test_a_removal_outside_the_domain_is_said() -> None:
    """Without the solenoids' dead zone of this drive they would overpower the spring."""
    drive = Drive.preset("neutral").replace(Z17=0.0075)
    Z = drive.parameters.numbers
    k = 0.99 * Z["Z4"] ** 0.5 / Z["Z5"] / (drive.steady_current(10.0) - 0.0075)
    strong = drive.replace(Z19=k, Z20=0.0, Z21=0.0, Z22=0.0, Z16=2e-5)
    found = limit_shares(strong, maneuvers.sine(4.0, 0.1).sample())
    (share,) = (each for each in found.shares if each.limit == "dead zone")
    assert share.error is share.error_share is None
    assert "the solenoid would overpower the feedback spring" in share.failure
    assert found.shares[-1] is share
    assert found.first is not None
    assert found.first.limit == "orifice"


def test_a_command_outside_the_domain_is_refused() -> None:
    """With little damping the filter overshoots, and the solenoid with it."""
    drive = Drive.preset("neutral")
    Z = drive.parameters.numbers
    k = 0.95 * Z["Z4"] ** 0.5 / Z["Z5"] / drive.steady_current(10.0)
    nervous = drive.replace(Z19=k, Z20=0.0, Z21=0.0, Z22=0.0, zeta=0.6, lim1=1.0, I_t1=1e-3)
    step = maneuvers.step(10.0).sample()
    nervous.simulate(step)  # its ramp keeps it from overshooting
    with pytest.raises(DomainError, match="limits the drive"):
        limit_shares(nervous, step)
    found = limit_shares(nervous, step, reference=np.zeros(step.size))
    (share,) = (each for each in found.shares if each.limit == "current rate")
    assert share.error is None
    assert "overpowers the feedback spring" in share.failure
