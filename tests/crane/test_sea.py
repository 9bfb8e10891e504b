"""Seaways and ships: against closed forms, published hulls and plain sums."""

from math import pi, radians, sin
from pathlib import Path

import h5py
import numpy as np
import pytest
from tests.fuzz.seeds import HEADINGS, MOTIONS, OMEGAS, capytaine, small_body

from swashplate.crane import (
    SEA_STATES,
    Crane,
    Hull,
    OperatorCommand,
    Seaway,
    Spectrum,
    read_ship,
    ship_motion,
    simulate,
)
from swashplate.errors import FileError, InputError

G = 9.80665
HULL = Hull(203.8, 23.2, 9.75)
S175 = Path(__file__).parents[3] / "shared" / "data" / "s175" / "input.re1"


@pytest.fixture(scope="module")
def s175():
    if not S175.exists():
        pytest.skip(f"the S175's transfer functions are not at {S175}")
    return read_ship(S175)


@pytest.mark.parametrize(
    ("factor", "height", "crossing"), [(1.0, 0.87979, 5.3932), (3.3, 0.88093, 5.8867)]
)
def test_spectrum_has_the_moments_that_were_worked_out_apart(factor, height, crossing):
    omega = np.linspace(0.05, 6.0, 200_001)
    density = Spectrum(0.88, 7.5, factor).density(omega)
    m0, m2 = (np.trapezoid(density * omega**n, omega) for n in (0, 2))
    assert 4.0 * np.sqrt(m0) == pytest.approx(height, abs=2e-5)
    assert 2.0 * pi * np.sqrt(m0 / m2) == pytest.approx(crossing, abs=2e-4)


def test_a_seaway_is_a_gaussian_process_of_the_height_asked_for():
    heights, sizes = [], []
    for seed in range(40):
        waves = Seaway("ss3", seed=seed).waves
        heights.append(4.0 * np.sqrt(0.5 * (np.abs(waves.amplitude) ** 2).sum()))
        # of a Rayleigh variable by its expected square
        sizes.append(np.abs(waves.amplitude) ** 2 / (2.0 * Seaway("ss3").bins.variance))
    assert np.mean(np.square(heights)) == pytest.approx(0.88**2, rel=0.01)
    # the scatter of Hs in 4096 s, by the spectrum: half of √(Σ S²)/Σ S
    variance = Seaway("ss3").bins.variance
    expected = 0.5 * np.sqrt((variance**2).sum()) / variance.sum()
    assert np.std(heights) / 0.88 == pytest.approx(expected, rel=0.4)
    # an exponential variable: mean 1, and above 3 in e^-3 of all cases
    assert np.mean(sizes) == pytest.approx(1.0, abs=0.01)
    assert np.mean(np.array(sizes) > 3.0) == pytest.approx(np.exp(-3.0), rel=0.05)


@pytest.mark.parametrize("spectrum", [(1.0, 3.0), (1.0, 4.0), (0.88, 7.5), (5.0, 12.4, 7.0)])
def test_the_components_variances_add_up_to_the_height(spectrum):
    sea = Seaway(Spectrum(*spectrum))
    assert 4.0 * np.sqrt(sea.bins.variance.sum()) == pytest.approx(spectrum[0], rel=1e-12)
    density = Spectrum(*spectrum).density(sea.bins.frequency)
    np.testing.assert_allclose(
        sea.bins.variance / sea.bins.variance.sum(),
        density / density.sum(),
        rtol=1e-12,
        atol=1e-300,
    )


def test_short_seas_say_how_much_lies_outside_the_waves_that_are_simulated():
    assert Seaway("ss3").sentences() == ()
    # Bretschneider's energy above 6 rad/s: 1 - exp(-1.25 (2π/2.5/6)⁴), 3.8 %
    (sentence,) = Seaway(Spectrum(0.5, 2.5)).sentences()
    assert "4 % of the energy of the sea (0.5 m, 2.5 s)" in sentence
    assert Spectrum(0.5, 2.5).share(0.2, 6.0) == pytest.approx(
        np.exp(-1.25 * (2.0 * pi / 2.5 / 6.0) ** 4), abs=1e-5
    )


def test_seaways_come_again_by_their_seed():
    waves = Seaway("ss3", seed=5).waves
    np.testing.assert_array_equal(waves.amplitude, Seaway("ss3", seed=5).waves.amplitude)
    assert not np.array_equal(waves.amplitude, Seaway("ss3", seed=6).waves.amplitude)


@pytest.mark.parametrize(
    "how",
    [
        {},
        {"speed": 6.0, "heading_deg": 130.0},
        # waves of 6 rad/s are met at 43 rad/s, beyond half of the coarse rate
        {"speed": 10.0, "heading_deg": 180.0, "ship": Hull(12.0, 4.0, 1.0)},
        # the ship overtakes waves above 0.98 rad/s
        {"speed": 10.0, "heading_deg": 0.0, "ship": Hull(12.0, 4.0, 1.0)},
        {"spread": True, "record": 5000.0},
        {"list_deg": 3.0, "trim_deg": -1.0, "reference": (-30.0, 0.0, 9.0)},
    ],
)
def test_motion_at_the_coarse_rate_is_the_plain_sum(how):
    sea = Seaway("ss4", seed=2, **how)
    waves = sea.waves
    motion = sea.motion(32 * 300 + 1, rate=32.0)
    some = np.r_[0, 4, 8, 300, 4800, 9600]
    turned = np.exp(1j * np.outer(some / 32.0, waves.encounter)) * waves.amplitude
    plain = (turned @ sea.response(waves.frequency, waves.heading).T).real
    plain[:, 3] += radians(sea.list_deg)
    plain[:, 4] += radians(sea.trim_deg)
    np.testing.assert_allclose(motion[some], plain, atol=1e-9)
    if not sea.spread:
        omega = waves.frequency
        met = omega - omega**2 / G * sea.speed * np.cos(waves.heading)
        assert np.abs(waves.encounter - met).max() <= pi / sea.period * (1.0 + 1e-9)


def test_motion_between_the_coarse_points_is_the_plain_sum():
    sea = Seaway("ss4", heading_deg=130.0, seed=2, speed=3.0)
    waves = sea.waves
    some = np.r_[1, 63, 65, 1000, 12345, 30719]
    turned = np.exp(1j * np.outer(some / 512.0, waves.encounter)) * waves.amplitude
    plain = (turned @ sea.response(waves.frequency, waves.heading).T).real
    np.testing.assert_allclose(sea.motion(60 * 512 + 1)[some], plain, atol=2e-7)


def test_the_same_time_has_the_same_motion_whatever_is_asked_for():
    sea = Seaway("ss3", seed=3)
    long = sea.motion(1000 * 64 + 1, rate=64.0)
    np.testing.assert_array_equal(sea.motion(777, rate=64.0), long[:777])
    np.testing.assert_allclose(sea.motion(97, rate=512.0)[::8], long[:13], atol=1e-12)


def test_a_record_comes_again_only_at_its_end():
    sea = Seaway("ss3", seed=3, record=4097.0)
    assert sea.period == 8192.0
    heave = sea.motion(8192 * 8 + 1, rate=8.0)[:, 2]
    assert heave[-1] == pytest.approx(heave[0], abs=1e-12)
    # the autocorrelation of heave from 600 s to half of the record, over its value at 0
    power = np.abs(np.fft.rfft(heave[:-1])) ** 2
    correlation = np.fft.irfft(power)
    assert np.abs(correlation[600 * 8 : 4096 * 8]).max() < 0.3 * correlation[0]
    with pytest.raises(InputError, match=r"8192 s, .*record=16384\)"):
        sea.motion(8192 * 8 + 2, rate=8.0)


def test_motions_are_those_of_the_cranes_origin():
    # heave of a point 30 m forward of a pitching ship: the bow goes down
    point = (-30.0, 4.0, 9.0)
    sea = Seaway("ss3", heading_deg=160.0, reference=point)
    omega, heading = np.array([0.4, 0.6]), np.full(2, radians(160.0))
    own = HULL.response(omega, heading)
    moved = sea.response(omega, heading)
    np.testing.assert_allclose(moved[3:], own[3:])
    roll, pitch, yaw = own[3:]
    x, y, z = 30.0, -4.0, -9.0
    np.testing.assert_allclose(moved[0], own[0] + pitch * z - yaw * y)
    np.testing.assert_allclose(moved[1], own[1] + yaw * x - roll * z)
    np.testing.assert_allclose(moved[2], own[2] + roll * y - pitch * x)


@pytest.mark.slow
def test_a_listed_ship_carries_the_boom_to_the_side_that_is_down():
    crane = Crane.preset("tg3637")
    lists = [Seaway(Spectrum(1e-6, 7.5), list_deg=angle) for angle in (0.0, 5.0)]
    runs = [
        simulate(crane, OperatorCommand.rest(1.0), sea=sea, slew_deg=90.0, actuation="ideal")
        for sea in lists
    ]
    upright, listed = (run.tip[0] for run in runs)
    # starboard, where the boom points, goes down by a turn of 5 degrees about the x axis
    c, s = np.cos(radians(5.0)), np.sin(radians(5.0))
    assert listed[1] == pytest.approx(c * upright[1] - s * upright[2], abs=1e-5)
    assert listed[2] == pytest.approx(s * upright[1] + c * upright[2], abs=1e-5)
    assert listed[2] < upright[2]


def test_spread_seas_come_from_around_their_heading():
    sea = Seaway("ss3", heading_deg=90.0, seed=1, spread=True)
    off = sea.waves.heading - radians(90.0)
    assert np.abs(off).max() <= pi / 2.0
    # cos² has the variance π²/12 - 1/2
    assert off.var() == pytest.approx(pi**2 / 12.0 - 0.5, rel=0.02)
    assert 4.0 * np.sqrt(0.5 * (np.abs(sea.waves.amplitude) ** 2).sum()) == pytest.approx(
        0.88, rel=0.05
    )


# --- ships ----------------------------------------------------------------------------------------

# heave [m/m] and pitch [deg/m] worked out apart, with g = 9.81 m/s²
CLOSED_FORM = [
    (Hull(82.8, 19.2, 6.0), 5.0, 75.0, 10.0, 1.10965, 0.67057),
    (HULL, 0.0, 135.0, 8.0, 0.17526, 0.01095),
    (HULL, 0.0, 135.0, 12.0, 0.51690, 0.84655),
]


@pytest.mark.parametrize(("hull", "speed", "heading", "period", "heave", "pitch"), CLOSED_FORM)
def test_closed_form_is_the_published_one(hull, speed, heading, period, heave, pitch):
    # waves of the published length, under way at the published ratio of frequencies
    scale = np.sqrt(G / 9.81)
    omega = np.array([2.0 * pi / period * scale])
    found = hull.response(omega, np.array([radians(heading)]), speed * scale)
    # published are magnitudes: waves shorter than the hull lift it where its middle is in a trough
    assert abs(found[2, 0]) == pytest.approx(heave, abs=1e-5)
    assert np.degrees(abs(found[4, 0])) == pytest.approx(pitch, abs=1e-5)


def hull_motions(heading, omega):
    return HULL.response(np.array([omega]), np.array([heading]))[:, 0]


def goes_with_the_water(ship, heading_deg, omega, carried, turned):
    """Within tolerances of what it is carried by, and of what it is turned by over the slope."""
    found = ship.response(np.array([omega]), np.array([radians(heading_deg)]))[:, 0]
    off = np.abs(found - small_body(radians(heading_deg), omega))
    assert (off[:3] < carried).all()
    assert (off[3:5] < turned * omega**2 / G).all()


# roll of the S175 in its longest wave is up by its resonance at 0.31 rad/s
@pytest.mark.parametrize(("ship", "omega", "near"), [("hull", 0.06, 0.05), ("s175", 0.1047, 0.4)])
@pytest.mark.parametrize("heading", [0.0, 90.0, 180.0, 270.0])
def test_ships_in_a_long_wave_go_with_the_water(request, heading, ship, omega, near):
    made = HULL if ship == "hull" else request.getfixturevalue("s175")
    goes_with_the_water(made, heading, omega, 0.02, near)


def test_s175_abeam_has_the_published_motions(s175):
    found = s175.response(np.array([0.8377581, 0.5711987]), np.full(2, pi / 2.0))
    assert found[1] == pytest.approx([0.0655 - 0.5601j, 0.0184 - 0.7834j], abs=2e-4)
    assert found[2] == pytest.approx([1.0850 - 0.8516j, 1.0877 - 0.0280j], abs=2e-4)
    assert found[3] == pytest.approx([-0.00269 + 0.00156j, -0.00212 + 0.00776j], abs=2e-5)
    assert (s175.speeds.size, s175.headings.size, s175.frequencies.size) == (5, 19, 36)


def test_s175_in_sea_state_3_moves_as_the_files_own_points_say(s175):
    # significant single amplitudes abeam: 0.205 m, 0.40 m, 0.079 degrees
    abeam = s175.values[0, 9]
    density = SEA_STATES["ss3"].density(s175.frequencies)
    energy = np.trapezoid(np.abs(abeam) ** 2 * density[:, None], s175.frequencies, axis=0)
    motions = [Seaway("ss3", seed=seed, ship=s175).motion(4096 * 8, 8.0) for seed in range(10)]
    std = np.std(np.concatenate(motions), axis=0)
    np.testing.assert_allclose(std[1:4], np.sqrt(energy[1:4]), rtol=0.03)


HEADER = ",".join(["heading_deg,omega", *(f"{each}_re,{each}_im" for each in MOTIONS)])


@pytest.fixture
def table(tmp_path):
    """A ship read from a table of a body's motions, each times a factor."""

    def made(body, headings=(0.0, 90.0, 180.0), frequencies=OMEGAS, factors=1.0, without=0):
        rows = [HEADER]
        for heading in headings:
            for omega in frequencies:
                motions = (body(radians(heading), omega) * factors).tolist()
                parts = [part for z in motions for part in (z.real, z.imag)]
                rows.append(",".join(map(repr, (heading, omega, *parts))))
        path = tmp_path / "ship.csv"
        path.write_text("\n".join(rows[: len(rows) - without]), "utf-8")
        return read_ship(path)

    return made


def test_table_gives_what_it_was_made_of(table):
    ship = table(hull_motions, frequencies=(0.1, 0.5, 1.0))
    at = np.array([0.5, 1.0]), np.array([radians(90.0), radians(-90.0)])
    np.testing.assert_allclose(ship.response(*at), HULL.response(*at), atol=1e-12)
    between = ship.response(np.array([0.75]), np.array([pi / 2.0]))[2]
    ends = HULL.response(np.array([0.5, 1.0]), np.full(2, pi / 2.0))[2]
    assert between == pytest.approx(ends.mean())


# --- files of other programs ----------------------------------------------------------------------


def wamit_lines(length=80.0):
    lines = []
    for omega in OMEGAS:
        for heading in (*HEADINGS, 270.0):
            motions = small_body(radians(heading), omega) * [1, 1, 1, length, length, length]
            for i, z in enumerate(motions.tolist(), 1):
                size, phase = abs(z), np.degrees(np.angle(z))
                lines.append(
                    f"{2 * pi / omega:14.6e} {heading:13.6e} {i:6d} {size:14.6e} {phase:14.6e} "
                    f"{z.real:14.6e} {z.imag:14.6e}"
                )
    return lines


@pytest.mark.parametrize("program", ["wamit", "capytaine"])
def test_files_of_other_programs_go_with_the_water_in_a_long_wave(tmp_path, program):
    path = tmp_path / ("ship.4" if program == "wamit" else "ship.nc")
    if program == "wamit":
        path.write_text("\n".join(wamit_lines()), "utf-8")
        ship = read_ship(path, 80.0)
    else:
        capytaine(path)
        ship = read_ship(path)
    assert ship.headings.size == 5
    assert ship.frequencies == pytest.approx(OMEGAS)
    for heading in (*HEADINGS, -90.0, 210.0):
        goes_with_the_water(ship, heading, 0.2, 3e-6, 7e-4)


def test_cut_files_and_other_conventions_are_refused(tmp_path):
    path, lines = tmp_path / "ship.4", wamit_lines()
    nc = tmp_path / "ship.nc"

    def refused(message, text, error=FileError):
        path.write_text("\n".join(text), "utf-8")
        with pytest.raises(error, match=message):
            read_ship(path, 80.0)

    refused("yaw for 0.5 rad/s and 180 deg; .* truncated", lines[:-7])
    refused("line 3: motion .* period", [*lines[:2], lines[2][:30]])
    refused("ship.4 .* no motions", [])
    # headings counted from where waves come: everything but heave the other way
    turned = [
        line[:14] + f" {(180.0 - float(line.split()[1])) % 360.0:13.6e}" + line[28:]
        for line in lines
    ]
    refused("0 deg surge .* water, .*-1j times", turned, InputError)
    with pytest.raises(InputError, match="ULEN .* 0 m"):
        read_ship(path, 0.0)
    capytaine(nc, sign=1.0)
    with pytest.raises(InputError, match="longest wave of 0 deg surge"):
        read_ship(nc)
    with h5py.File(nc, "a") as file:
        del file["RAO"]
    for _ in range(2):
        with pytest.raises(FileError, match=r"ship\.nc .*RAO"):
            read_ship(nc)
        nc.write_text("nothing", "utf-8")


def test_waves_from_the_other_side_follow_by_symmetry(tmp_path):
    path, lines = tmp_path / "ship.4", wamit_lines()

    def written(first):
        angles = [float(line.split()[1]) or first for line in lines]
        pairs = zip(lines, angles, strict=True)
        kept = [f"{line[:14]} {at:13.6e}{line[28:]}" for line, at in pairs if at != 90.0]
        path.write_text("\n".join(kept), "utf-8")
        return read_ship(path, 80.0)

    # the 270 deg of the file stand for its 90 deg, and 360 deg for 0
    for first in (0.0, 360.0):
        goes_with_the_water(written(first), 90.0, 0.2, 3e-6, 7e-4)


def test_rotations_in_degrees_and_single_headings_are_refused(table):
    degrees_ = [1.0, 1.0, 1.0, 180.0 / pi, 180.0 / pi, 180.0 / pi]
    with pytest.raises(InputError, match="0.1 rad/s, pitch .* in rad"):
        table(small_body, factors=degrees_)
    with pytest.raises(FileError, match="180 deg .* 90 deg"):
        table(small_body, (0.0, 180.0))
    beam = table(small_body, (90.0,))
    assert beam.response(np.array([0.2]), np.array([pi / 2.0]))[2] == pytest.approx(1.0)
    with pytest.raises(InputError, match="waves of 90 deg"):
        beam.response(np.array([0.2]), np.array([0.0]))


def test_measured_motion_comes_from_a_log(tmp_path):
    path, time = tmp_path / "ship.csv", np.arange(0.0, 40.0, 0.1)
    rows = [f"{t:.1f};{0.5 * sin(0.7 * t):.9f};{2.0 * sin(0.5 * t + 1.0):.9f}" for t in time]
    path.write_text("\n".join(["time [s];heave [m];roll [deg]", *rows]), "utf-8")
    made = ship_motion(path, {"heave": "heave", "roll": "roll"})
    assert made.shape == (20429, 6)
    fine = np.arange(len(made)) / 512.0
    np.testing.assert_allclose(made[:, 2], 0.5 * np.sin(0.7 * fine), atol=1e-5)
    np.testing.assert_allclose(made[:, 3], np.radians(2.0) * np.sin(0.5 * fine + 1.0), atol=1e-6)
    assert not made[:, [0, 1, 4, 5]].any()
    run = simulate(Crane.preset("tg3637"), OperatorCommand.rest(20.0), sea=made, actuation="ideal")
    assert run.swing_deg.max() > 0.05
    with pytest.raises(InputError, match="column .surge.; .*: name the one"):
        ship_motion(path)
    with pytest.raises(InputError, match="surge, .* rolling"):
        ship_motion(path, {"rolling": "roll"})
    # degrees under a header that says nothing, or says radians
    path.write_text("\n".join(["time [s];heave [m];roll [rad]", *rows]), "utf-8")
    with pytest.raises(InputError, match=r"ship.csv: roll .* 2 rad, .* roll \[deg\]"):
        ship_motion(path, {"roll": "roll"})
    with pytest.raises(InputError, match="sea's motion: pitch .* 3 rad"):
        simulate(
            Crane.preset("tg3637"),
            OperatorCommand.rest(1.0),
            sea=np.full((600, 6), 3.0) * [0, 0, 0, 0, 1, 0],
        )
    path.write_text("\n".join(["time [s];heave [m];roll [deg]", *rows[:100], *rows[301:]]), "utf-8")
    with pytest.raises(InputError, match="heave from 9.9 to 30.1 s"):
        ship_motion(path, {"heave": "heave"})


# --- refusals -------------------------------------------------------------------------------------


def test_cut_and_strange_files_are_refused_by_their_line(tmp_path, s175):
    lines = S175.read_text("utf-8").splitlines()
    cut = tmp_path / "cut.re1"
    cut.write_text("\n".join(lines[:500]), "utf-8")
    with pytest.raises(FileError, match=r"cut.re1, line 501: .* missing, .*truncated"):
        read_ship(cut)
    cut.write_text("\n".join(["something else", *lines[1:]]), "utf-8")
    with pytest.raises(FileError, match="VERES"):
        read_ship(cut)


def test_tables_that_lack_something_or_mean_something_else_are_refused(tmp_path, table):
    with pytest.raises(FileError, match="surge for 0.5 rad/s and 180 deg"):
        table(hull_motions, without=1)
    with pytest.raises(FileError, match="0 to 180 deg"):
        table(hull_motions, (0.0, 90.0))
    with pytest.raises(InputError, match=r"longest wave heave .* -1.00.* 1 \+ 0i"):
        table(hull_motions, factors=[1.0, 1.0, -1.0, 1.0, 1.0, 1.0])  # z down
    with pytest.raises(InputError, match="wave of 90 deg roll .* water"):
        table(hull_motions, factors=[1.0, 1.0, 1.0, -1.0, 1.0, 1.0])
    table(hull_motions)
    path = tmp_path / "ship.csv"
    path.write_text(path.read_text("utf-8").replace("heave_im", "heave"), "utf-8")
    with pytest.raises(FileError, match="line 2: heave_im "):
        read_ship(path)


def test_files_that_lack_much_of_the_sea_are_refused(table):
    ship = table(hull_motions, frequencies=(0.1, 0.5, 1.4))
    # Bretschneider's energy above ω is 1 - exp(-1.25 (ω_p/ω)⁴): 14.8 % with a peak at 7.5 s, of
    # which hardly any lies beyond 6 rad/s; below 0.7 rad/s there are 7.7 %, above 2.5 rad/s 1.6 %
    with pytest.raises(InputError, match=r"0.1 to 1.4 rad/s, .* 15 % .* \(ss3\)"):
        Seaway("ss3", ship=ship)
    swell = Seaway("ss3-swell", ship=ship)
    assert swell.motion(10).shape == (10, 6)
    # above 1.4 rad/s: 1 - exp(-1.25 (2π/11/1.4)⁴)
    (sentence,) = swell.sentences()
    assert "0.1 to 1.4 rad/s: for the 3.4 % of the energy of the sea (ss3-swell)" in sentence
    with pytest.raises(InputError, match=r"0.7 to 2.5 rad/s, .* 9 % .* \(ss3\)"):
        Seaway("ss3", ship=table(hull_motions, frequencies=(0.7, 1.0, 2.5)))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Seaway("ss3", seed=-1), "seed of a seaway .* -1"),
        (lambda: Spectrum(0.0, 7.5), "height of a sea .* 0, .* 1e-06 to 30"),
        (lambda: Seaway("ss3", heading_deg=1e308), "heading .* 720 deg .* 1e.308 deg"),
        (lambda: Seaway("ss3", record=100.0), "record of a seaway .* 100 s, .* 4096 to 131072 s"),
        (lambda: Seaway("ss3", list_deg=60.0), "List and trim .* 60 and 0 deg, .* 45 deg"),
        (lambda: Seaway("ss3", reference=(1.0, 2.0)), "point forward, port and up"),
        (lambda: Spectrum(1e308, 7.5), "height of a sea .* 1e.308, .* 30"),
        (lambda: Spectrum(1.0, 7.5, 50.0), "peak_factor of a sea .* 50, .* 10"),
        (lambda: Hull(1e300, 20.0, 9.0), "hull's length .* 1e.300, .* 1 to 600"),
        (lambda: Hull(80.0, 20.0, 1e-300), "hull's draught .* 1e-300, .* 0.05 to 50"),
        (lambda: Spectrum(1.0, 60.0), "60 s .* 1.05 and 31.4 s"),
        (lambda: Hull(0.0, 20.0, 9.0), "hull's length .* 0"),
        (lambda: read_ship("hull.dat"), "hull.dat: .* .re1 of VERES"),
        (lambda: Seaway("ss3").motion(100, 500.0), "multiple of 8 Hz"),
    ],
)
def test_seas_that_make_no_sense_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_speed_beyond_the_table_is_refused(s175):
    with pytest.raises(InputError, match=r"0 to .* m/s, .* 45 m/s"):
        Seaway("ss3", ship=s175, speed=45.0).motion(10)
