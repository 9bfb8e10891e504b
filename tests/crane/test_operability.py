"""Operability over a scatter diagram, and the diagrams themselves."""

import time
from dataclasses import replace

import numpy as np
import pytest

from swashplate.crane import (
    Crane,
    RunOutcome,
    Scatter,
    Seaway,
    Spectrum,
    Study,
    TransferFunctions,
    control,
    linear_response,
    operability,
)
from swashplate.crane.studies import UNDECIDED, WORKABLE, operating
from swashplate.crane.studies.operating import LEFT, NEAR
from swashplate.errors import FileError, InputError
from swashplate.executors import Serial

SHORT = {"length": 300.0, "run_in": 60.0, "seeds": range(8)}
CLIPPED = control.DelayedFeedback(0.2, 0.2) | control.ShipCompensation() | control.Clip()


@pytest.fixture(scope="module")
def crane():
    return Crane.preset("tg3637")


@pytest.fixture(scope="module")
def scatter():
    return Scatter.of([0.1, 0.3, 0.6, 2.5, 0.5], [6.0, 6.0, 6.0, 6.0, 10.0], [3, 3, 2, 1, 1])


@pytest.fixture(scope="module")
def found(crane, scatter):
    return operability(crane, CLIPPED, scatter, headings=(90.0,), **SHORT)


@pytest.mark.slow
def test_without_control_the_frequency_domain_decides(crane, scatter, found):
    """Each cell against the limits by hand: the largest of value over limit."""
    for row, (height, period) in enumerate(zip(scatter.height, scatter.period, strict=True)):
        sea = Seaway(Spectrum(float(height), float(period)))
        values = linear_response(crane, sea).values
        ratios = {
            name: values[name].largest / limit
            for name, limit in crane.limits_si.items()
            if name != "saturation"
        }
        worst = max(ratios, key=ratios.get)
        cell = found.cells["no control"][row, 90.0]
        assert cell.ratio == pytest.approx(ratios[worst], rel=1e-6)
        assert (cell.limited_by == WORKABLE) == (ratios[worst] <= 1.0)
        assert not cell.simulated


@pytest.mark.slow
def test_shares_are_those_of_the_cells_and_add_up_to_a_year(scatter, found):
    for name in found.names:
        assert sum(found.shares(name).values()) == pytest.approx(1.0)
        workable = sum(
            float(scatter.share[row])
            for (row, _), cell in found.cells[name].items()
            if cell.limited_by == WORKABLE
        )
        assert found.workable(name) == pytest.approx(workable)


@pytest.mark.slow
def test_what_is_beyond_a_limit_stays_so_in_higher_waves(scatter, found):
    heights = np.flatnonzero(scatter.period == 6.0)
    for name in found.names:
        workable = [
            found.cells[name][int(row), 90.0].limited_by == WORKABLE
            for row in heights[np.argsort(scatter.height[heights])]
        ]
        assert workable == sorted(workable, reverse=True)


@pytest.mark.slow
def test_cells_near_a_limit_are_simulated_as_a_study_is(crane, scatter, found):
    """A cell that was simulated has what a study of the same seaways says."""
    simulated = [
        (row, cell)
        for (row, _), cell in found.cells["identified"].items()
        if cell.simulated and np.isfinite(cell.ratio)
    ]
    assert simulated
    row, cell = simulated[0]
    sea = Seaway(Spectrum(float(scatter.height[row]), float(scatter.period[row])))
    study = Study.of(crane, CLIPPED, seeds=(0, 1), sea=sea, drives=("identified",), length=300.0,
                     run_in=60.0)  # fmt: skip
    outcomes = [one for (one,) in study.outcomes([study.cases["identified"]])]
    assert not any(outcome.departure_reason for outcome in outcomes)
    assert (cell.ratio > 1.0) == (cell.limited_by != WORKABLE)


def test_small_waves_are_not_simulated(crane):
    calm = Scatter.of([0.02], [7.0], [1.0])
    found = operability(crane, CLIPPED, calm, headings=(90.0,), length=300.0)
    assert not any(cell.simulated for cells in found.cells.values() for cell in cells.values())
    assert found.workable("identified") == 1.0
    assert NEAR > 1.0


@pytest.mark.slow
@pytest.mark.parametrize(("period", "said"), [(10.4, True), (6.0, False)])
def test_a_crew_that_damps_is_named_where_calm_seas_are_unworkable(crane, period, said):
    """27 m of rope swing in 10.4 s, and waves of 0.1 m with that peak make more than is allowed."""
    calm = Scatter.of([0.1], [period], [1.0])
    found = operability(crane, CLIPPED, calm, headings=(90.0,), drives=("ideal",), **SHORT)
    assert (found.workable("no control") == 0.0) is said
    assert any("a crew does" in sentence for sentence in found.sentences()) is said


@pytest.mark.slow
def test_huge_waves_leave_the_model_and_say_so(crane):
    storm = Scatter.of([9.0], [12.0], [1.0])
    found = operability(crane, CLIPPED, storm, headings=(90.0,), drives=("identified",),
                        length=300.0)  # fmt: skip
    assert found.workable("identified") == 0.0
    (cell,) = found.cells["identified"].values()
    assert cell.limited_by not in (WORKABLE, "")
    assert LEFT != WORKABLE


@pytest.mark.slow
def test_the_hoist_is_too_slow_from_a_height_on(crane, scatter, found):
    height, period, heading = found.hoist_limit
    values = linear_response(crane, Seaway(Spectrum(height, period), heading_deg=heading)).values
    assert values["hoist_demand"].largest == pytest.approx(1.0, rel=1e-6)
    assert any(
        "The hoist is slower than the hook's vertical motion" in words
        for words in found.sentences()
    )


@pytest.mark.slow
def test_numbers_do_not_depend_on_who_runs_them(crane, scatter, found):
    again = operability(crane, CLIPPED, scatter, headings=(90.0,), executor=Serial(), **SHORT)
    assert all(again.shares(name) == found.shares(name) for name in found.names)


@pytest.mark.slow
def test_table_has_a_row_for_each_variant(found):
    (table,) = found.tables()
    assert [row.cells[0] for row in table.rows] == ["no control", "ideal", "identified"]
    assert table.rows[0].cells[1] == found.workable("no control")


def test_seaways_of_a_cell_are_as_many_as_asked_for(crane):
    one = operability(crane, CLIPPED, Scatter.of([0.3], [6.0], [1.0]), headings=(90.0,),
                      drives=("identified",), length=300.0, seeds=range(1))  # fmt: skip
    assert "in 1 seaway of 5 min" in " ".join(one.sentences())


@pytest.mark.slow
def test_each_cell_is_a_row(scatter, found):
    frame = found.to_polars()
    assert frame.height == 3 * len(scatter.height)
    assert frame["share"].sum() == pytest.approx(3.0)
    calm = frame.filter(variant="no control", hs=0.1)
    assert calm["limited_by"].to_list() == [""]
    assert calm["heading"].to_list() == [pytest.approx(np.pi / 2.0)]


@pytest.mark.slow
def test_what_was_computed_is_said(found):
    words = " ".join(found.sentences())
    parts = (
        "delayed feedback of 0.2 at 0.2 periods, ship compensation, a clip at 0.8",
        "boom 45 deg up and 90 deg from the bow",
        "rope 27 m",
        "load 35000 kg",
        "the clip is 0.24 m along the boom",
        "4 to 8 seaways, as many as decide, of 5 min",
        "Equally likely headings: 90 deg.",
    )
    for part in parts:
        assert part in words
    assert "place and saturation" in words  # limits that are assumed


def test_a_ship_that_does_not_reach_a_sea_of_the_diagram_is_refused_by_that_sea(crane):
    class Short(TransferFunctions):
        def __post_init__(self):
            pass

    grid = np.linspace(0.2, 1.5, 20)
    ship = Short("short.csv", np.zeros(1), np.radians([0.0, 180.0]), grid,
                 np.zeros((1, 2, 20, 6), complex))  # fmt: skip
    with pytest.raises(InputError, match=r"short\.csv .*0\.5 m, 5 s"):
        operability(crane, CLIPPED, Scatter.of([0.5], [5.0], [1.0]), sea=Seaway(
            Spectrum(1.0, 12.0), ship=ship))  # fmt: skip


def test_a_crane_without_limits_has_no_operability(crane, scatter):
    with pytest.raises(InputError, match=r"tg3637 .* table \[limits\]"):
        operability(replace(crane, limits={}), CLIPPED, scatter)
    with pytest.raises(InputError, match="100 s, .* 300 s"):
        operability(crane, CLIPPED, scatter, length=100.0)


# --- the third answer -----------------------------------------------------------------------------


class Sea:
    """Made-up outcomes of a variant: values by a number of the seaway, in place of simulations."""

    def __init__(self, monkeypatch, made):
        self.heights = []
        self.made = made
        monkeypatch.setattr(Study, "outcomes", lambda *given: self.outcomes(*given))

    def outcomes(self, study, cases, numbers=None):
        height = study.seaway.spectrum.height
        self.heights.append((height, len(numbers)))
        return [
            tuple(
                self.made(height, number, case.command.length)
                if case.options["control"]
                else outcome(30.0, number)
                for case in cases
            )
            for number in numbers
        ]


def outcome(swing_deg, number, *, left_after=None, orifice=0.0):
    """A run whose swing has Rayleigh's peaks of that most probable value in three hours."""
    peaks = np.random.default_rng(number).rayleigh(size=80)
    # of the 1440 peaks of three hours one exceeds sqrt(2 ln 1440) of their scale
    swing = np.radians(swing_deg) / np.sqrt(2.0 * np.log(1440.0)) * peaks
    limits = np.zeros((3, 5))
    limits[2, 1] = orifice
    return RunOutcome(
        rms_swing=float(np.sqrt(np.mean(swing**2) / 2.0)),
        largest_swing=float(swing.max()),
        limits=limits,
        saturation=orifice,
        peaks={"swing": swing},
        evaluated_time=600.0 if left_after is None else left_after,
        departure_reason="" if left_after is None else "the load swings beyond 30 deg",
    )


def of_one_sea(crane, heights, limit="swing"):
    """Cells of the crane's own drives at 7 s with one limit, 8 deg of swing by default."""
    limited = replace(crane, limits={limit: crane.limits[limit]})
    scatter = Scatter.of(heights, [7.0] * len(heights), [1.0] * len(heights))
    unclipped = control.DelayedFeedback(0.2, 0.2) | control.ShipCompensation()
    found = operability(limited, unclipped, scatter, headings=(90.0,), drives=("identified",),
                        executor=Serial())  # fmt: skip
    return found, [found.cells["identified"][row, 90.0] for row in range(len(heights))]


def test_more_seaways_are_simulated_only_where_few_do_not_decide(crane, monkeypatch):
    """Limits of 8 deg: 2 and 20 deg are decided by four seaways, 8 deg by none."""
    for swing, runs in [(2.0, 4), (20.0, 4), (8.0, 60)]:
        sea = Sea(monkeypatch, lambda _, number, __, swing=swing: outcome(swing, number))
        _, (cell,) = of_one_sea(crane, [0.4])
        assert cell.simulated
        simulated = sum(number for height, number in sea.heights if height == 0.4)
        # those that work are also tried in the largest starts, a dozen, and four without control
        assert simulated == runs + (12 + 4 if swing < 8.0 else 0)
        assert cell.limited_by == {2.0: WORKABLE, 8.0: UNDECIDED}.get(swing, cell.limited_by)


@pytest.mark.parametrize(("failing", "answer"), [(0, WORKABLE), (1, UNDECIDED), (12, "no")])
def test_starts_that_are_not_taken_over_are_a_share_of_all(crane, monkeypatch, failing, answer):
    """Of 60 starts those with the largest swing fail; 12 of 60 are more than 5 % for certain."""
    study = Study.of(crane, CLIPPED, seeds=range(60), sea=Seaway(Spectrum(0.4, 7.0)))
    case = study.cases["identified"]
    swings = [case.swing_at_start(replace(study.seaway, seed=seed)) for seed in range(60)]
    fails = set(np.argsort(swings)[::-1][:failing])

    def made(_, number, length):
        assert length in (720.0, 300.0)  # short ones tell whether a start is taken over
        return outcome(2.0, number, left_after=60.0 if number in fails else None, orifice=0.4)

    Sea(monkeypatch, made)
    _, (cell,) = of_one_sea(crane, [0.4])
    assert cell.limited_by == ("luff orifice" if answer == "no" else answer)


def test_what_is_undecided_is_a_share_of_the_year(crane, monkeypatch):
    Sea(monkeypatch, lambda height, number, _: outcome(20.0 * height, number))
    found, cells = of_one_sea(crane, [0.1, 0.4, 0.5])
    assert [cell.limited_by for cell in cells] == [WORKABLE, UNDECIDED, "swing"]
    assert found.undecided("identified") == pytest.approx(1.0 / 3.0)
    assert found.workable("identified") == pytest.approx(1.0 / 3.0)
    assert "Undecided is 33.3 % with 'identified'" in " ".join(found.sentences())
    (table,) = found.tables()
    assert [column.name for column in table.columns][:3] == ["variant", "workable", "undecided"]


# --- what limits first ----------------------------------------------------------------------------


@pytest.mark.slow
def test_without_control_the_first_limit_is_that_met_in_the_lowest_waves(crane, found, scatter):
    """By hand: each limit is met at a height, as all is linear in it."""
    for period in (6.0, 10.0):
        values = linear_response(crane, Seaway(Spectrum(0.1, period))).values
        met = {
            name: 0.1
            * (limit - abs(values[name].mean))
            / (values[name].largest - values[name].mean)
            for name, limit in crane.limits_si.items()
            if name in values
        }
        of_period = [
            found.cells["no control"][int(row), 90.0].limited_by
            for row in np.flatnonzero(scatter.period == period)
        ]
        assert set(of_period) <= {WORKABLE, min(met, key=met.get)}


def test_a_drive_that_limits_in_lower_waves_limits_higher_ones_too(crane, monkeypatch):
    """Runs leave the model from 0.1 m on, where the linear crane is within all its limits."""

    def made(height, number, _):
        return outcome(2.0, number, left_after=60.0 if height > 0.1 else None, orifice=0.9)

    Sea(monkeypatch, made)
    found, cells = of_one_sea(crane, [0.2, 0.5, 3.0, 6.0])
    assert {cell.limited_by for cell in cells} == {"luff orifice"}
    assert not any(np.isinf(cell.ratio) for cell in cells)
    assert found.to_polars().filter(variant="identified")["limited_by"].unique().to_list() == [
        "luff orifice"
    ]


def test_a_limit_that_drives_do_not_change_stays_first(crane, monkeypatch):
    """Runs stay in the model where the linear crane meets the hoist's speed."""
    Sea(monkeypatch, lambda _, number, __: outcome(2.0, number, orifice=0.4))
    _, cells = of_one_sea(crane, [0.02, 3.0], "hoist_demand")
    assert [cell.limited_by for cell in cells] == [WORKABLE, "hoist_demand"]


# --- scatter diagrams -----------------------------------------------------------------------------


def test_a_diagram_is_read_whatever_the_order_of_its_columns(tmp_path):
    path = tmp_path / "site.csv"
    path.write_text("# a place\nshare [%],tp [s],hs [m]\n30,7,0.5\n0,9,2\n10,8,1.5\n", "utf-8")
    found = Scatter.from_csv(path)
    np.testing.assert_array_equal(found.height, [0.5, 1.5])
    np.testing.assert_array_equal(found.period, [7.0, 8.0])
    np.testing.assert_allclose(found.share, [0.75, 0.25])
    assert not found.note


# 5 ft are 1.524 m by definition
@pytest.mark.parametrize(
    ("text", "height", "period"),
    [
        ("hs [ft],tp [s],share\n5,8,1\n", 1.524, 8.0),
        ("Hs (ft),Tp (min),Share\n5,0.2,1\n", 1.524, 12.0),
        ("hs_cm,tp_ms,share\n150,8000,1\n", 1.5, 8.0),
        ('"hs [m]";"tp [s]";"share"\n"1,5";"8,5";"10"\n', 1.5, 8.5),
        ("hs [m];tp [s];share [%]\n1,5;8,5;10\n", 1.5, 8.5),
        ("hs\ttp\tshare\n1.5\t8.5\t10.5\n", 1.5, 8.5),
        ("hs,tp,share\nft,s,%\n5,8,10\n", 1.524, 8.0),
    ],
)
def test_units_separators_and_decimal_signs_are_those_of_the_file(tmp_path, text, height, period):
    path = tmp_path / "site.csv"
    path.write_text(text, "utf-8")
    found = Scatter.from_csv(path)
    np.testing.assert_allclose([found.height, found.period], [[height], [period]])


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "empty"),
        ("hs,tp\n1,2\n", "first line; share "),
        ("hs,tp,share\n1,2\n", "3 names ... 2 fields"),
        ("hs,tp,share\n1,two,3\n", "tp ... 'two' ... line 2"),
        ("# x\nhs,tp,share\n1,-2,3\n", "Row 1 ... period of -2"),
        ("hs,tp,share\n1,8,3\n1,8,4\n", "1 m and 8 s twice"),
        ("hs,tp,share\n1,8,0\n", "shares ... 0"),
        ("hs,tp,share\n", "no rows"),
        ("hs,tp,share\n1,nan,1\n", "Row 1 ... period of nan"),
        ("hs,hs,tp,share\n1,2,8,1\n", "more than one column of hs"),
        ("hs [m],Hs [ft],tp,share\n1,2,8,1\n", "more than one column of hs ... 'Hs [ft]'"),
        ("hs [s],tp [s],share\n1,8,1\n", "'hs [s]' ... give it in m"),
        ("hs,tp [m],share\n1,8,1\n", "'tp [m]' ... give it in s"),
        ("hs,tp,share\n1e-300,8,1\n", "height ... 1e-300 ... 1e-06"),
        # 1/7 of a wave's length of g tp²/(2 pi) = 25 m
        ("hs,tp,share\n10,4,1\n", "10 m ... 4 s ... steeper ... 3.6 m"),
    ],
)
def test_what_is_no_diagram_is_said(tmp_path, text, sentence):
    path = tmp_path / "site.csv"
    path.write_text(text, "utf-8")
    with pytest.raises((FileError, InputError)) as error:
        Scatter.from_csv(path)
    for part in sentence.split(" ... "):
        assert part in str(error.value)
    assert str(path) in str(error.value)


def test_shares_of_any_size_are_divided_by_their_sum():
    np.testing.assert_allclose(Scatter.of([1, 2], [8, 8], [1e308, 1e308]).share, [0.5, 0.5])


def test_a_steep_sea_that_never_comes_is_no_fault():
    assert Scatter.of([10.0, 1.0], [4.0, 8.0], [0.0, 1.0]).height.tolist() == [1.0]


def test_a_diagram_of_many_rows_is_made_in_seconds(crane):
    heights, periods = np.meshgrid(np.linspace(0.1, 2.0, 400), np.linspace(5.0, 15.0, 101))
    begun = time.process_time()
    many = Scatter.of(heights.ravel(), periods.ravel(), np.ones(heights.size))
    with pytest.raises(InputError, match="101 different periods, .* 100 .* classes"):
        operability(crane, CLIPPED, many)
    assert time.process_time() - begun < 10.0  # minutes, when each row was compared with all others


@pytest.mark.parametrize(
    ("headings", "sentence"),
    [
        ((), "at least one heading"),
        ((90.0, 90.0), "90 and 90 deg are one"),
        ((90.0, 0.0, 450.0), "90 and 450 deg are one"),
        ((0.0, -90.0, 270.0), "-90 and 270 deg are one"),
        (range(0, 2000, 359), "heading .* 1077 deg"),
        ((0.0, float("nan")), "heading .* nan deg"),
    ],
)
def test_headings_are_checked_before_the_first_is_computed(
    crane, scatter, monkeypatch, headings, sentence
):
    monkeypatch.setattr(operating, "_of_column", None)  # which computes
    with pytest.raises(InputError, match=sentence):
        operability(crane, CLIPPED, scatter, headings=headings)


def test_a_diagram_that_is_not_there_is_said(tmp_path):
    with pytest.raises(FileError, match=r"none\.csv"):
        Scatter.from_csv(tmp_path / "none.csv")


def test_the_packaged_diagram_says_that_it_is_made_up():
    packaged = Scatter.packaged()
    assert packaged.share.sum() == pytest.approx(1.0)
    assert "scatter diagram is fictitious" in packaged.note
