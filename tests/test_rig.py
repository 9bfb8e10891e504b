"""The virtual rig: what is simulated, what instruments make of it, and the files of it."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from swashplate import Drive, FileError, InputError, maneuvers, rig
from swashplate.campaign import Campaign, ChannelKind

STEP = maneuvers.step(4.0)
FAST = maneuvers.step(9.0)
SINE = maneuvers.sine(4.0, 0.2, length=12.0)


def same(one: rig.VirtualRun, other: rig.VirtualRun) -> bool:
    return one.columns.keys() == other.columns.keys() and all(
        np.array_equal(values, other.columns[name], equal_nan=True)
        for name, values in one.columns.items()
    )


def split(drive: Drive) -> Drive:
    """The drive as the rig simulates it: its decay takes over within a step."""
    return Drive(replace(drive.parameters, card_switch="split"))


def test_clean_logs_are_the_model_to_the_last_bit() -> None:
    tests = rig.run("hoist", severity="clean")
    assert list(tests.runs) == list(maneuvers.source_tests("hoist"))
    assert sum(run.columns["time"].size for run in tests.runs.values()) == 110_605
    drive = split(Drive.preset("hoist").at_every_rate())
    for name, maneuver in maneuvers.source_tests("hoist").items():
        columns = tests.runs[name].columns
        model = drive.simulate(maneuver.sample())
        np.testing.assert_array_equal(columns["time"], np.arange(model.time.size) / 512.0)
        np.testing.assert_array_equal(columns["voltage"], model.voltage)
        np.testing.assert_array_equal(
            columns["current"], model.current_positive + model.current_negative
        )
        np.testing.assert_allclose(
            columns["counts"], model.shaft_position / (2.0 * np.pi) * 2526.315789473684, rtol=1e-14
        )


def test_a_realistic_log_leaves_noise_of_mean_zero_alone() -> None:
    """A fit drives the model by the voltage that was logged: that alone must give the truth."""
    tools = replace(rig.SEVERITIES["realistic"], lost_rows=0.0)
    tests = rig.run("hoist", instruments=tools)
    residuals = []
    for run in tests.runs.values():
        columns = run.columns
        how = {"time": columns["time"], "interpolation": "linear"}
        model = tests.drive.simulate(columns["voltage"], **how)
        current = model.current_positive + model.current_negative
        truth = run.truth.current_positive + run.truth.current_negative
        wrong = np.interp(run.truth.time, model.time, current) - truth
        # one code too much or too little is 4.9 mV, at 0.06 A/V 0.3 mA; beside the dead zone it
        # moves the jump of 0.27 A by a part of a sample, which the card's filter flattens
        assert np.abs(wrong).max() < 4e-3
        assert np.sqrt(np.mean(wrong**2)) < 1e-4
        # whole periods of the dither: 128 samples are 25
        whole = columns["current"].size // 128 * 128
        reading = columns["current"] - np.interp(columns["time"], model.time, current)
        residuals.append(reading[:whole])
        counts = model.shaft_position * tests.counts_per_turn / (2.0 * np.pi)
        counts = np.interp(columns["time"], model.time, counts)
        assert np.abs(counts - columns["counts"]).max() < 1.3
    together = np.concatenate(residuals)
    # 2 mA of noise, converter steps of 0.5 mA and a ripple of up to 15 mA
    assert 0.002 < together.std() < 0.015
    assert abs(together.mean()) < 4.0 * 0.002 / np.sqrt(together.size)


def test_the_same_seed_gives_the_same_logs_in_any_order_and_company() -> None:
    alone = rig.run("hoist", [STEP], seed=5, severity="harsh")
    last = rig.run("hoist", [SINE, STEP], seed=5, severity="harsh")
    first = rig.run("hoist", [STEP, SINE], seed=5, severity="harsh")
    assert same(alone.runs[STEP.name], last.runs[STEP.name])
    assert same(first.runs[SINE.name], last.runs[SINE.name])
    other = rig.run("hoist", [STEP], seed=6, severity="harsh")
    assert not same(alone.runs[STEP.name], other.runs[STEP.name])


SIGNALS = {
    "signed_current": "current",
    "current_plus": "current_positive",
    "current_minus": "current_negative",
    "position": "shaft_position",
    **{kind: kind for kind in ("shaft_speed", "stroker_pressure", "swash_angle", "spool_position")},
}


def test_other_channels_are_the_simulated_signals() -> None:
    run = rig.run("luff", [SINE], severity="clean", channels=tuple(SIGNALS)).runs[SINE.name]
    model = split(Drive.preset("luff").at_every_rate()).simulate(SINE.sample())
    assert list(run.columns) == ["time", "voltage", *SIGNALS]
    for column, signal in SIGNALS.items():
        np.testing.assert_array_equal(run.columns[column], model[signal])
    noisy = rig.run("luff", [SINE], channels=["swash_angle"]).runs[SINE.name].columns["swash_angle"]
    assert 0.0 < np.abs(np.diff(noisy[:500])).mean() < 0.02 * np.abs(noisy).max()


def test_backlash_is_between_shaft_and_encoder() -> None:
    loose = replace(rig.SEVERITIES["clean"], backlash=0.01)
    kinds = ("position", "shaft_speed", "encoder_counts")
    tests = rig.run("hoist", [SINE], instruments=loose, channels=kinds)
    run = tests.runs[SINE.name]
    np.testing.assert_array_equal(run.columns["shaft_speed"], run.truth.shaft_speed)
    lag = run.truth.shaft_position - run.columns["position"]
    assert lag.max() == pytest.approx(0.005, rel=1e-9)
    assert lag.min() == pytest.approx(-0.005, rel=1e-9)
    counts = run.columns["position"] * tests.counts_per_turn / (2.0 * np.pi)
    np.testing.assert_allclose(run.columns["counts"], counts, rtol=1e-14)


def test_perturbed_values_stay_within_the_spread() -> None:
    hoist = Drive.preset("hoist")
    numbers = hoist.at_every_rate().parameters.numbers
    logarithms = []
    for seed in range(10):
        tests = rig.run("hoist", [STEP], perturb=0.1, seed=seed, channels=["shaft_speed"])
        drawn = tests.drive.parameters.numbers
        for column, value in numbers.items():
            if value == 0.0 or not np.isfinite(value) or column == "Z14":
                assert drawn[column] == value
            else:
                logarithms.append(np.log(drawn[column] / value))
    spread = np.array(logarithms)
    assert np.abs(spread).max() <= 0.1 + 1e-12
    # a normal of half the spread, cut at twice its own: 0.88 of it is left
    assert spread.std() == pytest.approx(0.05 * 0.8796, rel=0.1)
    assert tests.drive.name == "hoist"
    assert tests.nominal == hoist


def test_tests_of_middle_size_are_kept_for_validation() -> None:
    tests = rig.run("slew", channels=["shaft_speed"])
    assert {n for n, run in tests.runs.items() if run.role == "validate"} == {"sine 4 V 0.1 Hz"}
    own = rig.run("hoist", [STEP, SINE], validate=[SINE.name])
    assert [run.role for run in own.runs.values()] == ["fit", "validate"]


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"severity": "awful"}, "severity ...'awful'... clean, realistic, harsh"),
        ({"seed": -1}, "seed ... whole number ... -1"),
        ({"maneuvers": []}, "one maneuver"),
        ({"maneuvers": [STEP, STEP]}, "maneuvers ... same name"),
        ({"maneuvers": {"a b": STEP, "a/b": STEP, "a_b": SINE}}, "same file"),
        ({"channels": ("counts",)}, "channel 'counts'... signed_current"),
        ({"channels": ()}, "channels ... once"),
        ({"validate": ["step 4 V"]}, "run 'step 4 V'"),
        ({"perturb": 0.9}, "perturb ... 0.5, ... 0.9"),
        ({"axis": "boom", "maneuvers": [STEP]}, "encoder of 'boom'"),
        ({"maneuvers": [20.0 * STEP]}, "±10 V"),
        ({"instruments": {"jitter": -1.0}}, "jitter ... 0 ... -1"),
        ({"instruments": {"dither": np.nan}}, "dither ... nan"),
        ({"instruments": {"lost_rows": 2.0}}, "lost_rows ... 1, ... 2"),
        ({"instruments": {"dither_frequency": 0.0}}, "dither_frequency ... positive"),
    ],
)
def test_what_cannot_be_run_is_refused(options: dict, sentence: str) -> None:
    def run(instruments: dict[str, float] | None = None, **more: object) -> None:
        tools = rig.Instruments(**instruments) if instruments else None
        rig.run("hoist", instruments=tools, **more)

    with pytest.raises(InputError) as error:
        run(**options)
    for part in sentence.split("..."):
        assert part in str(error.value)


# --- instruments ---------------------------------------------------------------------------------


def seen(
    *, kinds: tuple[ChannelKind, ...] = ("rectified_current",), **errors: float
) -> rig.VirtualRun:
    tests = rig.run("hoist", [FAST], instruments=rig.Instruments(**errors), channels=kinds)
    return tests.runs[FAST.name]


def both(run: rig.VirtualRun) -> np.ndarray:
    return run.truth.current_positive + run.truth.current_negative


def test_voltage_and_current_have_offset_gain_noise_and_steps() -> None:
    run = seen(
        command_bits=12, voltage_bits=12, voltage_noise=0.01,
        current_noise=2e-3, current_resolution=5e-4,
    )  # fmt: skip
    wrong = run.columns["voltage"] - run.truth.voltage
    assert wrong.std() == pytest.approx(0.01, rel=0.05)
    assert (run.columns["current"] - both(run)).std() == pytest.approx(2e-3, rel=0.05)
    for values, step in (
        (run.truth.voltage, 10.0 / 2048),
        (run.columns["voltage"], 10.0 / 2048),
        (run.columns["current"], 5e-4),
    ):
        np.testing.assert_allclose(values / step, np.rint(values / step), atol=1e-9)
        assert np.abs(values).max() < 10.0
    run = seen(voltage_offset=0.02, current_gain_error=0.01, current_zero=4e-3)
    np.testing.assert_allclose(run.columns["voltage"] - run.truth.voltage, 0.02, atol=1e-12)
    np.testing.assert_allclose(run.columns["current"], 1.01 * both(run) + 4e-3, rtol=1e-12)


def test_the_dither_shows_at_its_aliases() -> None:
    run = seen(dither=0.015)
    held = slice(1024, 3072)  # 2 s to 6 s: the current stands
    ripple = (run.columns["current"] - both(run))[held]
    power = np.abs(np.fft.rfft(ripple * np.hanning(ripple.size))) ** 2
    hertz = np.fft.rfftfreq(ripple.size, 1.0 / 512.0)
    assert hertz[power.argmax()] == pytest.approx(100.0, abs=0.3)
    beat = (hertz > 10.0) & (hertz < 14.0)  # the fifth multiple, 500 Hz, at 512 Hz
    assert power[beat].max() > 100.0 * np.median(power)


def test_counts_are_passed_edges_and_roll_over() -> None:
    run = seen(kinds=("encoder_counts",), encoder_step=4)
    turns = run.truth.shaft_position * 400.0 * 120.0 / 19.0 / (2.0 * np.pi)
    assert np.all(run.columns["counts"] % 4 == 0.0)
    assert np.abs(run.columns["counts"] - turns).max() <= 4.0
    small = seen(kinds=("encoder_counts",), encoder_step=1, counter_bits=8).columns["counts"]
    assert (small.min(), small.max()) == (-128.0, 127.0)


def test_stamps_tell_the_jitter_and_rows_and_cells_are_lost() -> None:
    run = seen(kinds=("shaft_speed",), jitter=2e-4, stamp_resolution=1e-6)
    stamps = run.columns["time"]
    assert (stamps - run.truth.time)[1:-1].std() == pytest.approx(2e-4, rel=0.05)
    speed = np.interp(stamps, run.truth.time, run.truth.shaft_speed)
    np.testing.assert_allclose(run.columns["shaft_speed"], speed, atol=2e-3)
    run = seen(jitter=1.0, lost_rows=0.05, longest_loss=20, empty_cells=0.01)
    assert np.diff(run.columns["time"]).min() > 0.0
    assert run.columns["time"].size == pytest.approx(0.95 * run.truth.time.size, rel=0.03)
    assert np.isnan(run.columns["current"]).mean() == pytest.approx(0.01, abs=0.006)


# --- files ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def harsh() -> rig.VirtualTests:
    return rig.run("hoist", [STEP, SINE], severity="harsh", seed=4)


def test_csv_logs_read_back_as_they_were(harsh: rig.VirtualTests, tmp_path: Path) -> None:
    rig.write(harsh, tmp_path)
    path = tmp_path / "hoist_step_4_V.csv"
    assert path.read_text("utf-8").startswith("# virtual: simulated by swashplate ")
    table = pl.read_csv(path, comment_prefix="#")
    columns = harsh.runs[STEP.name].columns
    assert table.columns == ["time", "voltage", "current", "counts"]
    assert table["counts"].dtype == pl.Int64
    for name, values in columns.items():
        read = table[name].cast(pl.Float64).fill_null(np.nan).to_numpy()
        np.testing.assert_array_equal(read, values)


@pytest.mark.parametrize("severity", ["clean", "realistic", "harsh"])
def test_a_campaign_reads_what_is_written(severity: rig.Severity, tmp_path: Path) -> None:
    tests = rig.run("hoist", [STEP, SINE], severity=severity, validate=[SINE.name])
    read = Campaign.from_toml(rig.write(tests, tmp_path / "new" / "folder"))
    assert read.virtual
    assert "Virtual" in read.title
    assert [each.maneuver for each in read] == ["step +4 V", "sine 4 V 0.2 Hz"]
    assert [each.role for each in read] == ["fit", "validate"]
    for experiment, run in zip(read, tests.runs.values(), strict=True):
        channel = experiment["counts"]
        truth = np.interp(channel.time, run.truth.time, run.truth.shaft_position)
        # a count is 2.5 mrad
        bound = {"clean": 1e-12, "realistic": 2.6e-3, "harsh": 2.6e-3}[severity]
        assert np.abs(channel.values - truth).max() < bound


def test_the_truth_lies_apart_and_a_drive_of_ones_own_beside(tmp_path: Path) -> None:
    tools = replace(rig.SEVERITIES["realistic"], backlash=0.01)
    crane = Drive.preset("hoist").scale(Z10=0.9).renamed('my "crane"')
    tests = rig.run(
        crane, {"a/b": STEP}, counts_per_turn=2500.0, perturb=0.1, instruments=tools, seed=12
    )
    assert tests.severity == "custom"
    read = Campaign.from_toml(rig.write(tests, tmp_path))
    truth = tomllib.loads((tmp_path / "truth" / "truth.toml").read_text("utf-8"))
    assert (truth["virtual"], truth["seed"]) == (True, 12)
    assert rig.Instruments(**truth["instruments"]) == tools
    assert {"swashplate", "numpy"} <= truth["versions"].keys()
    assert Drive.from_toml(tmp_path / "truth" / truth["drive"]) == tests.drive != crane
    assert read.axes['my "crane"'].drive == "drive.toml"
    assert Drive.from_toml(tmp_path / "drive.toml") == crane
    assert (tmp_path / "my_crane_a-b.csv").exists()


def test_a_folder_that_holds_something_is_kept(harsh: rig.VirtualTests, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(FileError, match=rf"{tmp_path.name} .* new folder, .* overwrit"):
        rig.write(harsh, tmp_path)
    assert [each.name for each in tmp_path.iterdir()] == ["notes.txt"]
    rig.write(harsh, tmp_path, overwrite=True)
    rig.write(harsh, tmp_path, overwrite=True)
    assert (tmp_path / "notes.txt").read_text() == "mine"
    with pytest.raises(FileError, match=r"notes\.txt .* folder"):
        rig.write(harsh, tmp_path / "notes.txt")
