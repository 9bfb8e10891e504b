"""A model of one's own in C: a folder that compiles, and the bits of its march."""

import shutil
import subprocess
from math import floor, tanh
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest
from tests.drive.test_own_equation import DRAGGED
from tests.export.conftest import InC
from tests.export.webassembly import Page
from tests.machine import test_taps_between
from tests.machine.test_own_model import COMMAND, STROKE, P, valve
from tests.marks import rest_slow

from swashplate import Drive
from swashplate.errors import EquationError, InputError
from swashplate.export import c, compare, content_of, drive_sources, fmu, libraries, values_of, wasm
from swashplate.export.c_source import Exported, interface
from swashplate.machine import (
    Definition,
    Machine,
    Model,
    Tap,
    discretised,
    equation,
    interpolate,
    join,
    repeated,
    root,
    simulate,
)
from swashplate.models import displacement_control
from swashplate.models.drive import drive

OFF = None
PULLED = (0.0, 0.2, 1.0)


class Tank(NamedTuple):
    area: float
    outlet: float
    delay: float
    leak: float = 0.0


class Level(NamedTuple):
    level: float = 0.25
    flow: float = 0.0


class Told(NamedTuple):
    head: float
    steps: float


class Ways(NamedTuple):
    rough: bool | None = OFF
    stepped: bool | None = OFF


class Full(NamedTuple):
    full: bool
    empty: bool


class Around(NamedTuple):
    height: float


@equation
def balance(flow: float, level: float, p: Tank) -> float:
    return flow * flow - p.outlet * level * abs(level) + p.leak * flow


@equation
def sunk(state: Level, number: float, p: Tank, h: float) -> Level:
    return Level(state.level - 0.1 * h * (1.0 + number) * p.leak * state.level, state.flow)


@equation
def tank_sample(state: Level, pumped: float, p: Tank, options: Ways) -> Told:
    head = interpolate(state.level, PULLED, (0.0, p.outlet, 2.0))
    steps = floor(4.0 * state.level + pumped)
    if options.stepped is not None:
        head = head - 0.25 * floor(head * 4.0)
    return Told(head, steps)


@equation
def tank_step(
    state: Level, signals: Told, pumped: float, outside: float, p: Tank, h: float, options: Ways,
    given: Around,
) -> Level:  # fmt: skip
    flow = root(balance, 0.0, 50.0, state.level, p)
    if options.rough is not None:
        flow = signals.head**3
    level = state.level
    for i in range(3):
        level = level + h * (pumped - flow) / (p.area * (i + 1.0))
    then = repeated(sunk, 3.0, Level(level, flow), p, h)
    return Level(min(max(then.level, outside), given.height), then.flow)


@equation
def tank_limits(state: Level, given: Around) -> Full:
    return Full(state.level >= given.height, not state.level > 0.02)


@equation
def tank_domain(state: Level) -> float:
    return 9.0 - state.level


tank = Model(
    "tank",
    parameters=Tank,
    state=Level,
    step=tank_step,
    sample=tank_sample,
    options=Ways,
    given=Around,
    taps={"pumped": Tap("pumped", delay="delay")},
    defaults={"outside": "leak"},
    limits=tank_limits,
    domain=tank_domain,
    integrals={"drained": "flow"},
)
NUMBERS, AROUND, RATE = Tank(0.5, 0.8, 0.033, 0.01), Around(1.5), 50.0
PUMPED = 0.3 + 0.4 * np.sin(np.arange(400) / 9.0)
INPUTS = {"pumped": PUMPED, "outside": 0.1 + 0.05 * np.cos(np.arange(400) / 30.0)}
NAMES = ("head", "steps", "level", "flow", "drained")


def exported(machine: Machine, compiled: Any, rate: float) -> InC:
    content = content_of(machine, 1.0 / rate, prefix=machine.name)
    return InC(compiled(interface(content.exported)), machine.name, content.values)


@pytest.mark.parametrize(
    "options", rest_slow([Ways(), Ways(rough=True), Ways(stepped=True), Ways(True, True)])
)
def test_roots_tables_loops_and_options_have_the_bits_of_the_march(
    options: Ways, compiled: Any
) -> None:
    run = simulate(Machine(tank, NUMBERS, options=options, given=AROUND), INPUTS, RATE)
    model = exported(Machine(tank, NUMBERS, given=AROUND), compiled, RATE)
    for name in ("rough", "stepped"):
        number = model.number("_option", name)
        assert model.set_option(number, getattr(options, name) is not None) == 0
    outside, places = model.number("_input", "outside"), [model.number("_output", n) for n in NAMES]
    for n in range(PUMPED.size):
        assert model.set_input(outside, float(INPUTS["outside"][n])) == 0
        assert model.step(float(PUMPED[n])) == 0
        assert [model.output(place) for place in places] == [run[name][n] for name in NAMES]
    assert np.ptp(run["level"]) > 0.1


class Inertia(NamedTuple):
    lag: float = 0.1


class Filtered(NamedTuple):
    value: float = 0.0


Supply = Annotated[float, Definition("supply pressure", "bar", lower=0.0, upper=200.0)]
Return = Annotated[float, Definition("return pressure", "bar", lower=1.0)]


@equation
def filtered(state: Filtered, supply: Supply, back: Return, p: Inertia, h: float) -> Filtered:
    return Filtered(state.value + h / p.lag * (supply - back - state.value))


@equation
def euler_margin(p: Inertia, h: float) -> float:
    return 2.0 - h / p.lag


def test_c_refuses_what_the_march_refuses(compiled: Any) -> None:
    """Inputs beyond their ranges, steps that are too long, and parameters that make them so."""
    ok, bad_value, unstable = range(3)
    model = Model("filter", Inertia, Filtered, filtered, stable=euler_margin, longest_step=0.01)
    machine = Machine(model, Inertia())
    with pytest.raises(InputError, match=r"step is 0\.02 s, .* at most 1/100 s"):
        content_of(machine, 0.02)
    content = content_of(machine, 0.01, prefix="filter")
    in_c = InC(compiled(interface(content.exported)), "filter", content.values)
    steps = {(100.0, 2.0): ok, (-1.0, 2.0): bad_value, (201.0, 2.0): bad_value}
    steps |= {(1.0, 0.5): bad_value, (200.0, 1.0): ok}
    for pressures, status in steps.items():
        assert in_c.step(*pressures) == status, pressures
        if status == ok:
            continue
        records = {
            name: np.full(3, value)
            for name, value in zip(("supply", "back"), pressures, strict=True)
        }
        with pytest.raises(InputError, match="pressure"):
            simulate(machine, records, 100.0)
    assert in_c.set(in_c.number("", "lag"), 0.004) == ok
    assert in_c.step(100.0, 2.0) == unstable
    with pytest.raises(InputError, match="unstable"):
        simulate(machine.replace(lag=0.004), {"supply": np.ones(3), "back": np.ones(3)}, 100.0)
    header, _ = interface(content.exported).values()
    assert "supply pressure [bar], 0 to 200" in header


class Oil(NamedTuple):
    stiffness: float
    drag: float


class Motion(NamedTuple):
    pressure: float
    speed: float


@equation
def oil_rates(state: Motion, flow: float, p: Oil) -> Motion:
    return Motion(p.stiffness * (flow - state.speed), state.pressure - p.drag * tanh(state.speed))


class Lag(NamedTuple):
    time: float


class Place(NamedTuple):
    place: float


@equation
def follow(state: Place, head: float, p: Lag, h: float) -> Place:
    return Place(state.place + h / p.time * (head - state.place))


@equation
def gap(head: float, place: float) -> float:
    return head - place


follower = Model("follower", Lag, Place, follow)


CYLINDER = Model("cylinder", Oil, Motion, discretised(oil_rates, "midpoint"))
SERIES = join("line", tank, follower, links={"gap": gap}, integrals={"travel": "place"})
MODELS = {
    "valve": (valve, P, STROKE, "command", COMMAND, "opening position"),
    "in series": (
        SERIES,
        SERIES.parameters(NUMBERS, Lag(0.1)),
        SERIES.given(AROUND),
        "pumped",
        PUMPED,
        "place gap travel level",
    ),
    "continuous": (CYLINDER, Oil(40.0, 2.0), None, "flow", PUMPED, "pressure speed"),
}


@pytest.mark.parametrize("case", MODELS.values(), ids=MODELS)
def test_a_model_has_the_bits_of_its_march(case: Any, compiled: Any) -> None:
    model, numbers, given, name, command, outputs = case
    run = simulate(Machine(model, numbers, given=given), {name: command}, RATE)
    found = exported(Machine(model, numbers, given=given), compiled, RATE)
    for output, values in found.run(command, outputs.split()).items():
        assert np.ptp(values) > 0.1, output
        assert (run[output] == values).all(), output


@pytest.mark.parametrize("start", ["rest", "steady"])
def test_past_samples_of_signals_between_parts_have_the_bits_of_the_march(
    start: str, compiled: Any
) -> None:
    own, command = test_taps_between.machine(), test_taps_between.COMMAND + 0.7
    run = simulate(own, {"command": command}, 1.0 / test_taps_between.H, start=start)
    found = exported(own, compiled, 1.0 / test_taps_between.H)
    if start == "steady":
        assert found.settle(float(command[0])) == 0
    assert np.array_equal(found.run(command, ["out"])["out"], run["out"])


class Numbered(NamedTuple):
    height: float | None = None


@equation
def numbered(state: Place, p: Lag, options: Numbered) -> Place:
    return Place(0.0 if options.height is None else options.height)


def test_an_option_that_is_a_number_is_refused_by_name() -> None:
    with pytest.raises(EquationError, match=r"Numbered\.height .*float.*bool \| None"):
        interface(Exported(Model("numbered", Lag, Place, numbered, options=Numbered), "swp"))


# what both sides of an option need is computed before it, what one alone needs on that side; and
# where the same option is asked again, what the first time has made is still there


class Twice(NamedTuple):
    rough: bool | None = OFF


@equation
def twice(state: Place, command: float, p: Lag, options: Twice) -> Place:
    first = 0.2 * command
    if options.rough is not None:
        first = repeated(halved, 3.0, tanh(command) / p.time, p) + tanh(command)
    second = tanh(first + state.place) / (1.0 + command * command)
    if options.rough is not None:
        second = second + tanh(command) / p.time + tanh(second)
    return Place(0.5 * state.place + second)


@equation
def halved(state: float, number: float, p: Lag) -> float:
    return state - 0.5 * p.time * state / (1.0 + number)


@pytest.mark.parametrize("options", [Twice(), Twice(True)])
def test_what_an_option_has_made_is_there_when_it_is_asked_again(
    options: Twice, compiled: Any
) -> None:
    model = Model("twice", Lag, Place, twice, options=Twice)
    run = simulate(Machine(model, Lag(0.3), options=options), {"command": PUMPED}, RATE)
    made = exported(Machine(model, Lag(0.3), options=options), compiled, RATE)
    assert (made.run(PUMPED, ["place"])["place"] == run["place"]).all()
    assert np.ptp(run["place"]) > 0.1


def test_a_constant_that_is_no_number_where_it_is_not_needed_is_none_of_the_numbers_checked(
    compiled: Any,
) -> None:
    """0/0 of parameters, on the side of a branch that is not taken."""
    model = Model("guarded", Gap, Place, guarded)
    run = simulate(Machine(model, Gap(0.0, 0.0)), {"command": PUMPED}, RATE)
    made = exported(Machine(model, Gap(0.0, 0.0)), compiled, RATE)
    assert (made.run(PUMPED, ["place"])["place"] == run["place"]).all()


class Gap(NamedTuple):
    width: float
    reach: float


@equation
def guarded(state: Place, command: float, p: Gap) -> Place:
    slope = p.reach / p.width
    if command > 100.0:
        return Place(slope * tanh(command) + tanh(slope + command))
    return Place(0.5 * state.place + command)


def test_a_domain_that_is_left_is_said(compiled: Any) -> None:
    model = exported(Machine(tank, NUMBERS, given=Around(99.0)), compiled, RATE)
    assert 4 in [model.step(200.0) for _ in range(100)]
    assert model.step(float("nan")) == 1


def test_limits_are_bits(compiled: Any) -> None:
    model = exported(Machine(tank, NUMBERS, given=AROUND), compiled, RATE)
    seen = set()
    for pumped in [3.0] * 60 + [-9.0] * 60:
        assert model.step(pumped) == 0
        seen.add(model.limits())
    assert seen == {0, 1, 2}


# --- FMU and WebAssembly --------------------------------------------------------------------------

FINE = 64.0
"""Rate whose times are binary, so that an importer interpolates no input. [Hz]"""


@pytest.fixture
def machine() -> list[str]:
    """This machine's platform, if a library can be compiled for it."""
    own = libraries.this_machine()
    if own is None or not (libraries.has_zig() or shutil.which("cc")):
        pytest.skip("there is no C compiler here")
    return [name for name, each in libraries.PLATFORMS.items() if each is own]


@pytest.mark.parametrize("fmi", rest_slow(["3.0", "2.0"]))
def test_an_fmu_of_a_model_has_the_bits_of_its_march(
    fmi: Any, tmp_path: Path, machine: list[str]
) -> None:
    fmpy = pytest.importorskip("fmpy")
    tank_of_numbers = Machine(tank, NUMBERS, options=Ways(stepped=True), given=AROUND)
    to = tmp_path / "tank.fmu"
    path = fmu(tank_of_numbers, to, fmi=fmi, step=1.0 / FINE, platforms=machine)
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(path)) == []
    read = fmpy.read_model_description(str(path))
    variables = {each.name: each for each in read.modelVariables}
    assert float(variables["outlet"].start) == NUMBERS.outlet
    assert variables["area"].variability == "tunable"
    assert variables["stepped"].start == "true"
    assert {each.name for each in read.modelVariables if each.causality == "output"} == {*NAMES}
    columns = {"time": np.arange(400) / FINE, **INPUTS}
    signals = np.rec.fromarrays(list(columns.values()), names=list(columns))
    for options in (Ways(stepped=True), Ways(True, True)):
        run = simulate(Machine(tank, NUMBERS, options=options, given=AROUND), INPUTS, FINE)
        found = fmpy.simulate_fmu(
            str(path), stop_time=399.0 / FINE, output_interval=1.0 / FINE, input=signals,
            output=NAMES, start_values={"rough": options.rough is not None},
        )  # fmt: skip
        for name in NAMES:
            assert (found[name] == run[name]).all(), name


# --- joined models --------------------------------------------------------------------------------


class Barge(NamedTuple):
    """A barge that two winches pull on one rope each, straight ahead."""

    radius: float = 0.3
    stiffness: float = 8e4
    mass: float = 4e5
    drag: float = 2e4


class Pulled(NamedTuple):
    port: float = 0.0
    starboard: float = 0.0
    position: float = 0.0
    speed: float = 0.0


class Pulls(NamedTuple):
    port_pull: float
    starboard_pull: float


@equation
def pulls(state: Pulled, p: Barge) -> Pulls:
    angles = state.port, state.starboard
    return Pulls(*(max(0.0, p.stiffness * (p.radius * a - state.position)) for a in angles))


@equation
def pulled(
    state: Pulled, signals: Pulls, port_speed: float, starboard_speed: float, p: Barge, h: float
) -> Pulled:
    force = signals.port_pull + signals.starboard_pull - p.drag * state.speed * abs(state.speed)
    speed = state.speed + h * force / p.mass
    return Pulled(
        state.port + h * port_speed,
        state.starboard + h * starboard_speed,
        state.position + h * speed,
        speed,
    )


tug = join(
    "tug",
    {"port": drive, "starboard": drive, "barge": Model("barge", Barge, Pulled, pulled, pulls)},
    links={f"barge.{side}_speed": f"{side}.shaft_speed" for side in ("port", "starboard")},
)


@pytest.mark.slow
def test_an_fmu_of_two_drives_on_one_load_has_the_bits_of_its_march(
    tmp_path: Path, machine: list[str]
) -> None:
    fmpy = pytest.importorskip("fmpy")
    parts = Drive.preset("hoist").parts
    winch = drive.parameters(*(part.p for part in parts))
    options = drive.options(*(part.options for part in parts))
    both = tug.options(options, options)
    tugging = Machine(tug, tug.parameters(winch, winch, Barge()), options=both)
    path = fmu(tugging, tmp_path / "tug.fmu", step=1.0 / 512.0, platforms=machine)
    time = np.arange(1500) / 512.0
    inputs = {
        "port.voltage": np.where(time > 0.2, 6.0, 0.0),
        "starboard.voltage": np.where(time > 0.5, 5.0, 0.0),
    }
    run = simulate(tugging, inputs, 512.0)
    columns = {"time": time, **inputs}
    signals = np.rec.fromarrays(list(columns.values()), names=list(columns))
    names = ["barge.position", "barge.port_pull", "port.shaft_position", "starboard.shaft_speed"]
    found = fmpy.simulate_fmu(
        str(path), stop_time=float(time[-1]), output_interval=1.0 / 512.0, input=signals,
        output=names,
    )  # fmt: skip
    assert run["position"][-1] > 0.1
    for name in names:
        assert (found[name] == run[name]).all(), name
    compared = compare(path, tugging, inputs)
    assert compared.equal
    assert {*names, "port.current", "starboard.motor_torque"} <= compared.differences.keys()


@pytest.mark.slow
def test_webassembly_of_a_model_has_the_bits_of_its_march(tmp_path: Path) -> None:
    if not libraries.has_zig():
        pytest.skip("ziglang is not installed")
    machine = Machine(tank, NUMBERS, given=AROUND)
    page = Page(wasm(machine, tmp_path / "a.wasm", step=1.0 / RATE))
    names = content_of(machine, 1.0 / RATE).exported.names
    found = page.run([PUMPED], 1.0 / RATE, [names.index(each) for each in NAMES])
    run = simulate(Machine(tank, NUMBERS, given=AROUND), {"pumped": PUMPED}, RATE)
    for name, values in zip(NAMES, found, strict=True):
        assert (values == run[name]).all(), name
    assert page.call("run", 1) == 1  # it has no equation for a settled start


def test_webassembly_says_what_overflows_and_takes_no_place_beyond_its_rows(
    hoist: Drive, tmp_path: Path
) -> None:
    page = Page(wasm(hoist, tmp_path / "hoist.wasm"))
    step, volts = 1.0 / 512.0, np.full(20, 9.0)
    names = [name for _, _, name in content_of(hoist, step).exported.named("parameters")]
    expected = hoist.simulate(volts, interpolation="previous").current
    assert page.call("begin", 2**31 - 1, step, 1) == 1
    for place in (-1, 16, 2**31 - 1):
        page.call("select", place, 0)
    (current,) = page.run([volts], step, [2])
    assert (current == expected).all()
    assert page.call("set", names.index("pump_speed"), 1e308) == 0
    assert page.call("run", 0) == 4  # SWP_DOMAIN


# --- folders --------------------------------------------------------------------------------------


def test_a_folder_of_c_compiles_and_runs(compiled: Any, hoist: Drive, tmp_path: Path) -> None:
    for what, numbers, steady in (
        (hoist.renamed("2-axis"), {}, hoist.steady_speed(9.0)),
        (Machine(valve, P, given=STROKE), {"step": 0.01}, None),
    ):
        files = c(what, tmp_path / what.name, **numbers)
        sources = {file.name: file.read_text("utf-8") for file in files}
        assert {"main.c", "CMakeLists.txt", "README.md"} <= set(sources)
        assert {"_2_axis_values.h", "valve_values.h"} & set(sources)
        program = compiled(sources, program="example")
        printed = subprocess.run([program], capture_output=True, text=True, check=True).stdout
        rows = [line.split() for line in printed.splitlines()]
        assert len(rows) > 15
        assert float(rows[-1][0]) == pytest.approx(2.0, abs=0.11)
        if steady is not None:
            assert float(rows[-1][1]) == pytest.approx(steady, rel=1e-6)


class Register(NamedTuple):
    switch: float
    register: float


@equation
def register_step(state: Register, double: float, short: float, p: Lag, h: float) -> Register:
    switch = state.switch + h / p.time * (double - state.switch)
    return Register(switch, state.register + h * short)


@pytest.mark.slow
def test_names_that_c_keeps_for_itself(compiled: Any, tmp_path: Path) -> None:
    model = Model("volatile", Lag, Register, register_step)
    files = c(Machine(model, Lag(0.5)), tmp_path, 0.01)
    program = compiled({each.name: each.read_text("utf-8") for each in files}, program="example")
    printed = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    run = simulate(Machine(model, Lag(0.5)), {"double": np.ones(201), "short": 1.0}, 100.0)
    last = [float(line.split()[1]) for line in printed.splitlines()]
    np.testing.assert_allclose(last, run["register"][::10], rtol=1e-8)


@equation
def slower_root(head: float) -> float:
    return 0.9 * head / (1.0 + abs(head) ** 2 / 1e14)


SLOWER = Drive.preset("hoist").with_equation(displacement_control.head_root, slower_root)


# of the sealed drive the equation calls the one whose place it takes
@pytest.mark.slow
@pytest.mark.parametrize("own", [SLOWER, DRAGGED], ids=["another", "on top"])
def test_a_drive_with_an_equation_of_its_own_has_it_in_c(
    own: Drive, compiled: Any, hoist: Drive
) -> None:
    command = 9.0 * np.sin(np.arange(1500) / 80.0)
    run = own.simulate(command, 512.0, interpolation="previous", start="steady")
    model = InC(compiled(drive_sources(own)), "swp", values_of(own))
    assert model.settle(float(command[0])) == 0
    found = model.run(command, ["shaft_speed"])["shaft_speed"]
    assert (run.shaft_speed == found).all()
    plain = hoist.simulate(command, 512.0, interpolation="previous", start="steady")
    assert (plain.shaft_speed != found).any()
