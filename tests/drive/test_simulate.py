"""Records, steppers and results: what is taken, what is refused, what is given back."""

import numpy as np
import polars as pl
import pytest

from swashplate import DomainError, Drive, FileError, InputError, Limit, maneuvers


def test_held_between_stamps(hoist: Drive) -> None:
    run = hoist.simulate([0.0, 3.0, -2.0], time=[1.0, 1.3, 2.0], interpolation="previous", rate=100)
    assert run.time[0] == 1.0
    assert run.time[-1] == pytest.approx(2.0)
    assert list(np.unique(run.voltage)) == [-2.0, 0.0, 3.0]
    assert run.voltage[29] == 0.0
    assert run.voltage[30] == 3.0  # a stamp counts from the sample that it falls on
    assert run.voltage[99] == 3.0
    assert run.voltage[100] == -2.0


@pytest.mark.parametrize(
    ("voltage", "options", "sentence"),
    [
        ([], {}, "voltage .* empty"),
        ([1.0, np.nan, 2.0], {}, "nan .* sample 1"),
        ([[1.0, 2.0]], {}, "voltage .* 2-dimensional"),
        (["a"], {}, "voltage .* real numbers"),
        ([0.0, 10.5], {}, "10.5 V .* 0.00195312 s.* ±10 V"),
        ([0.0, 1.0], {"time": [0.0], "interpolation": "linear"}, "1 .* 2 samples"),
        ([0.0, 1.0], {"time": [0.0, 0.0], "interpolation": "linear"}, "0 s .* sample 0 .* 0"),
        ([0.0, 1.0], {"time": [0.0, np.nan], "interpolation": "linear"}, "time .* 1 sample"),
        ([0.0, 1.0], {"interpolation": "cubic"}, "'linear' or 'previous'"),
        ([0.0, 1.0], {"start": "warm"}, "'rest' or 'steady'"),
        ([0.0, 1.0], {"rate": 100.0, "substeps": 3}, "3.* 6 "),
        ([0.0, 1.0], {"time": [0.0, 1.0]}, "interpolation='previous'"),
        ([0.0, 1.0], {"time": [0.0, 3.6e6], "interpolation": "linear"}, "3.6e.06 s.* unit"),
    ],
)
def test_bad_records_are_refused_in_a_sentence(
    hoist: Drive, voltage: list, options: dict, sentence: str
) -> None:
    with pytest.raises(InputError, match=sentence):
        hoist.simulate(voltage, **options)


def test_clipping_is_on_request_only(hoist: Drive) -> None:
    run = hoist.simulate([0.0, 12.0, -11.0], clip=True)
    assert list(run.voltage) == [0.0, 10.0, -10.0]


def test_a_result_does_not_change_with_the_users_array(hoist: Drive) -> None:
    voltage = np.full(100, 5.0)
    run = hoist.simulate(voltage)
    voltage[:] = 0.0
    assert run.voltage[50] == 5.0
    with pytest.raises(ValueError, match="read-only"):
        run.shaft_speed[0] = 1.0


def test_solenoid_overpowering_the_spring_is_an_error() -> None:
    hoist = Drive.preset("hoist")
    with pytest.raises(DomainError, match="Z5·F/√Z4 .* 1"):
        hoist.simulate_current(np.full(10, 4.0))


def test_bad_command_leaves_the_state(hoist: Drive) -> None:
    stepper = hoist.stepper()
    stepper.step(1.0)
    before = stepper.state
    for bad in (10.1, float("nan"), float("-inf")):
        with pytest.raises(InputError, match="±10"):
            stepper.step(bad)
    assert (stepper.state.inputs == before.inputs).all()
    assert (stepper.state.context.states == before.context.states).all()
    assert (stepper.state.context.lines == before.context.lines).all()


@pytest.mark.slow
@pytest.mark.parametrize("rate", [512.0, 200.0])
def test_what_is_measured_goes_into_a_step_as_into_a_simulation(hoist: Drive, rate: float) -> None:
    drive, n = hoist.replace(load_inertia=5e3, motor_leakage=1e-6), np.arange(1200)
    voltage, load = 6.0 * np.sign(np.sin(n / 200.0)), 2e4 * np.cos(n / 60.0)
    given = {"load_torque": load, "pump_speed": 1.0 - 0.1 * (n > 800)}
    stepper = drive.stepper(rate, interpolation="previous", measured=tuple(given))
    made = [stepper.step(*each).shaft_speed for each in zip(voltage, *given.values(), strict=True)]
    run = drive.simulate(voltage, rate, interpolation="previous", **given)
    assert made == run.shaft_speed.tolist()


@pytest.mark.parametrize(
    ("measured", "inputs", "said"),
    [
        (["lad"], (1.0, 2.0), "hoist .*'lad'.* voltage, pump_speed"),
        (["pump_speed"], (1.0, -1.0), "pump_speed .*-1.0, .* 0 to 10"),
        (["supply_pressure"], (1.0, 0.0), "supply_pressure .* 0.0, .* 1 to"),
        (["pump_speed"], (1.0, 1800.0), "pump_speed .* 1800.0, .* 0 to 10"),
        (["pump_speed"] * 2, (1.0, 1.0, 1.0), "input once"),
    ],
)
def test_measured_inputs_without_sense_are_refused(hoist: Drive, measured, inputs, said) -> None:
    with pytest.raises(InputError, match=said):
        hoist.stepper(measured=measured).step(*inputs)


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("pump_speed", 1e308, "1e.308, .* 10"),
        ("pump_speed", 75.0, "75, .* 10: .* per cent"),
        ("load_torque", -1e300, "-1e.300 N m, .* 1e.10 N m"),
        ("load_torque", 4e10, "4e.10 N m, .* N mm .* N m"),
        ("supply_pressure", 1e10, "1e.10 Pa, .* 10000 to 1e.09 Pa"),
        ("supply_pressure", 107.0, "107 Pa, .* 10000 to 1e.09 Pa: .* bar .* Pa"),
    ],
)
def test_what_no_machine_has_is_refused_with_its_range(
    hoist: Drive, name: str, value: float, sentence: str
) -> None:
    """The largest sample decides: a pump that stops leaves next to no pressure."""
    with pytest.raises(InputError, match=rf"{name} .* {sentence}"):
        hoist.simulate(np.full(10, 1.0), **{name: value})
    stopping = np.r_[np.full(5, 8e6), np.full(5, 2.0)]
    assert hoist.simulate(np.full(10, 1.0), supply_pressure=stopping).shaft_speed.size == 10


def test_a_sample_that_is_not_finite_is_an_error_that_names_it(hoist: Drive) -> None:
    """Numbers that overflow in an output alone: the states stay finite."""
    huge, voltage = Drive(hoist.parameters.with_numbers({"Z10": 1e308})), np.full(6000, 9.0)
    speed = np.where(np.arange(6000) < 512, 1.0, 10.0)
    with pytest.raises(DomainError, match=r"hoist: shaft_speed .* at 1 s.* voltage"):
        huge.simulate(voltage, pump_speed=speed, interpolation="previous")
    stepper = huge.stepper(measured=("pump_speed",))
    with pytest.raises(DomainError, match=r"hoist: shaft_speed .* voltage"):
        [stepper.step(*pair) for pair in zip(voltage, speed, strict=True)]
    many = hoist.simulate_many({"Z10": np.array([12.0, 1e308])}, voltage=voltage, pump_speed=speed)
    assert list(many.failures) == [1]
    assert np.isfinite(many.output[0]).all()


def test_an_integral_that_overflows_is_an_error_that_names_it(hoist: Drive) -> None:
    huge, voltage = Drive(hoist.parameters.with_numbers({"Z10": 1e308})), np.full(6000, 9.0)
    run = huge.simulate(voltage)
    assert np.isfinite(run.shaft_speed).all()
    for _ in range(2):
        with pytest.raises(DomainError, match="hoist: shaft_position"):
            run["shaft_position"]
    stepper = huge.stepper()
    with pytest.raises(DomainError, match="hoist: .*integral .* voltage"):
        [stepper.step(volts) for volts in voltage]


def test_state_of_another_rate_is_refused(hoist: Drive) -> None:
    with pytest.raises(InputError, match="delay or rate"):
        hoist.stepper(1e3).state = hoist.stepper(1e4).state


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), 1.0, 1e6])
def test_bad_rates_are_refused(hoist: Drive, rate: float) -> None:
    with pytest.raises(InputError, match="10 and 100000 Hz"):
        hoist.stepper(rate)


def test_steady_start_stays_steady(axis: Drive) -> None:
    stepper = axis.stepper(start="steady")
    samples = [stepper.step(3.0) for _ in range(500)]
    for sample in (samples[0], samples[-1]):
        assert sample.shaft_speed == pytest.approx(axis.steady_speed(3.0), rel=1e-9)
        assert sample.current == pytest.approx(axis.steady_current(3.0), rel=1e-12)


LARGE = {"Z7": 1e150}
REFINED = {"line_stiffness": 1e3, "motor_leakage": 1e-3, "load_inertia": 1.0}


@pytest.mark.slow
@pytest.mark.traced
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of NumPy, without the JIT
@pytest.mark.parametrize(
    "refinements",
    [{}, pytest.param(REFINED, marks=pytest.mark.slow)],
    ids=["plain", "refined"],
)
def test_numbers_that_overflow_are_refused(hoist: Drive, refinements: dict[str, float]) -> None:
    drive = Drive(hoist.parameters.with_numbers(LARGE | refinements))
    with pytest.raises(DomainError, match="hoist: .* overflow.* voltage"):
        drive.simulate(np.full(600, 5.0))
    with pytest.raises(DomainError, match="hoist: .* overflow.* current"):
        drive.simulate_current(np.full(600, 0.5))
    stepper = drive.stepper()

    def go_on() -> None:
        for _ in range(600):
            assert np.isfinite(stepper.step(5.0)).all()

    with pytest.raises(DomainError, match="hoist: .*overflow"):
        go_on()


def test_signals_fit_together(axis: Drive) -> None:
    run = axis.simulate(maneuvers.step(6.5).sample(512.0))
    Z = axis.parameters.numbers
    np.testing.assert_allclose(run.shaft_speed, Z["Z10"] * run.swash_angle, rtol=1e-14)
    np.testing.assert_array_equal(run.current, run.current_positive - run.current_negative)
    assert np.abs(run.orifice_opening).max() <= max(Z["Z16_plus"], Z["Z16_minus"])
    tangent = np.clip(
        Z["Z1"] * run.stroker_pressure, -np.tan(Z["Z13_minus"]), np.tan(Z["Z13_plus"])
    )
    np.testing.assert_allclose(np.tan(run.swash_angle), tangent, atol=1e-15)
    steps = np.diff(run.shaft_position)
    means = 0.5 * (run.shaft_speed[1:] + run.shaft_speed[:-1]) / 512.0
    np.testing.assert_allclose(steps, means, rtol=1e-9, atol=1e-12)


def test_limits_of_a_hard_step(hoist: Drive) -> None:
    run = hoist.simulate(maneuvers.step(9.0).sample(512.0))
    t = run.time
    assert run.active(Limit.DEAD_ZONE)[t < 1.0].all()
    assert not run.active(Limit.DEAD_ZONE)[(t > 1.1) & (t < 6.0)].any()
    assert run.active(Limit.CURRENT_RATE)[(t > 1.04) & (t < 1.2)].all()
    assert run.active(Limit.ORIFICE)[(t > 1.3) & (t < 2.0)].all()
    assert run.active(Limit.SWASH_STOP)[(t > 3.0) & (t < 6.0)].all()
    assert not run.active(Limit.SWASH_STOP)[t > 6.2].any()
    assert not run.active(Limit.SPOOL | Limit.RELIEF).any()
    # while the plate rests on its stop the orifice limits nothing
    assert not (run.active(Limit.ORIFICE) & run.active(Limit.SWASH_STOP) & (t < 6.0)).any()
    np.testing.assert_array_equal(
        run.active(Limit.SWASH_STOP), np.isclose(run.swash_angle, 0.27596, rtol=1e-14)
    )


def test_a_current_driven_run_has_no_voltage(hoist: Drive) -> None:
    run = hoist.simulate_current([0.3, -0.4, 0.5])
    assert run.voltage is None
    assert "voltage" not in run.to_polars().columns
    assert list(run.current_positive) == [0.3, 0.0, 0.5]
    assert list(run.current_negative) == [0.0, 0.4, 0.0]


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_files_give_back_what_was_written(hoist: Drive, tmp_path, ending: str) -> None:
    run = hoist.simulate(maneuvers.step(4.0).sample(512.0))
    path = tmp_path / f"run.{ending}"
    run.write(path)
    table = pl.read_csv(path) if ending == "csv" else pl.read_parquet(path)
    assert table.equals(run.to_polars())
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_unknown_ending_is_refused(hoist: Drive, tmp_path) -> None:
    run = hoist.simulate([0.0, 1.0])
    with pytest.raises(FileError, match=r"xlsx.* \.csv or \.parquet"):
        run.write(tmp_path / "run.xlsx")
    with pytest.raises(FileError, match=r"nowhere/run\.csv"):
        run.write(tmp_path / "nowhere" / "run.csv")
    assert not list(tmp_path.iterdir())


def test_a_failing_writer_leaves_the_old_file(tmp_path) -> None:
    from swashplate.tables import write_whole

    path = tmp_path / "run.csv"
    path.write_text("old")

    def write(beside) -> None:
        beside.write_text("half of the ne")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_whole(path, write)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["run.csv"]
