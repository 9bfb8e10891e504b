"""A machine without equations is simulated; whatever needs equations refuses in one sentence."""

import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from swashplate import (
    BlackBox,
    Definition,
    DomainError,
    InputError,
    ParameterError,
    export,
    join,
    linearize,
    maneuvers,
    sensitivities,
    settle,
    simulate,
    simulate_many,
    stepper,
    sweep,
)
from swashplate.report.fit_report import write_machine_page

RATE = 50.0
TIME = np.arange(101) / RATE
ONES = {"valve": np.ones(TIME.size), "bias": 0.25}


def level_of(time, inputs, numbers):
    """A lag behind a valve that is held from stamp to stamp, exactly."""
    level = np.full(time.size, numbers["start.level"])
    left = np.exp(-np.diff(time) / numbers["lag"])
    aim = 2.0 * inputs["valve"] + inputs["bias"]
    for k in range(time.size - 1):
        level[k + 1] = aim[k] + left[k] * (level[k] - aim[k])
    return {"level": level}


TANK = BlackBox(
    "tank",
    level_of,
    inputs=("valve", "bias"),
    outputs=("level",),
    numbers={"lag": 0.5, "start.level": 0.0},
    definitions={
        "valve": Definition("valve command", "V", lower=-10.0, upper=10.0),
        "level": Definition("level of the tank", "bar", upper=2.0),
        "lag": Definition("time constant", "s", above=0.0),
    },
)


def test_a_run_has_what_the_program_gives() -> None:
    run = simulate(TANK, ONES, RATE)
    assert run.names == ("time", "valve", "bias", "level")
    np.testing.assert_allclose(run.time, TIME, atol=1e-12)
    np.testing.assert_allclose(run["level"], 2.25 - 2.25 * np.exp(-TIME / 0.5), atol=1e-12)
    assert run.to_polars().columns == ["time", "valve", "bias", "level"]
    assert not run["level"].flags.writeable


def test_a_run_is_drawn_with_the_words_of_its_definitions() -> None:
    panels = simulate(TANK, ONES, RATE).plot().axes
    assert [panel.get_ylabel().partition("\n")[0] for panel in panels] == [
        "valve command",
        "bias",
        "level of the tank",
    ]


def test_it_takes_maneuvers_and_time_stamps() -> None:
    run = simulate(TANK, {"valve": maneuvers.step(3.0, start=1.0, stop=2.0), "bias": 0.0}, RATE)
    assert run["level"][run.time < 1.0].max() == 0.0
    stamps = np.array([0.0, 0.5, 2.0])
    uneven = {"time": stamps, "interpolation": "previous"}
    run = simulate(TANK, {"valve": [1.0, 0.0, 0.0], "bias": 0.0}, RATE, **uneven)
    assert run["level"][25] == pytest.approx(2.0 - 2.0 * np.exp(-1.0), rel=1e-9)


def test_numbers_are_replaced_by_name_and_with_units() -> None:
    slow = TANK.replace({"start.level": 1.0}, lag=2.0)
    assert slow.numbers == {"lag": 2.0, "start.level": 1.0}
    assert TANK.numbers["lag"] == 0.5
    assert simulate(slow, ONES, RATE)["level"][0] == 1.0
    with pytest.raises(ParameterError, match=r"tank: lag \(time constant\) is -1 s"):
        TANK.replace(lag=-1.0)
    with pytest.raises(InputError, match="tank has no parameter 'lagg'; there are lag"):
        TANK.replace(lagg=1.0)


def test_it_comes_back_from_another_process() -> None:
    again = pickle.loads(pickle.dumps(TANK.replace(lag=0.1)))
    assert again.numbers == {"lag": 0.1, "start.level": 0.0}
    np.testing.assert_array_equal(
        simulate(again, ONES, RATE)["level"], simulate(TANK.replace(lag=0.1), ONES, RATE)["level"]
    )


def test_the_program_cannot_change_what_it_is_given() -> None:
    def greedy(time, inputs, numbers):
        inputs["u"][0] = 1.0
        return {"y": inputs["u"]}

    box = BlackBox("greedy", greedy, inputs=("u",), outputs=("y",), numbers={})
    with pytest.raises(ValueError, match="read-only"):
        simulate(box, {"u": np.zeros(3)}, RATE)


SENTENCE = (
    "^tank is a black box: it is simulated, compared and fitted; for anything else write its "
    "equations as a Model.$"
)
AT = {"valve": 1.0, "bias": 0.0}
UNDER = {"valve": maneuvers.step(1.0), "bias": 0.0}
VERBS: dict[str, Callable[[Path], object]] = {
    "stepper": lambda folder: stepper(TANK, ["valve", "bias"], rate=RATE),
    "settle": lambda folder: settle(TANK, AT, RATE),
    "linearize": lambda folder: linearize(TANK, AT, RATE),
    "sweep": lambda folder: sweep(TANK, [1.0], [1.0], RATE, input="valve", output="level"),
    "sensitivities": lambda folder: sensitivities(TANK, ONES, RATE),
    "many": lambda folder: simulate_many(TANK, {"lag": [1.0]}, ONES, RATE, output="level"),
    "join": lambda folder: join("pair", {"left": TANK, "right": TANK}),
    "c": lambda folder: export.c(TANK, folder / "c"),
    "fmu": lambda folder: export.fmu(TANK, folder / "a.fmu"),
    "wasm": lambda folder: export.wasm(TANK, folder / "a.wasm"),
    "page": lambda folder: write_machine_page(TANK, folder / "a.html", UNDER),
}


@pytest.mark.parametrize("verb", VERBS)
def test_what_needs_equations_refuses_in_one_sentence(verb, tmp_path) -> None:
    with pytest.raises(InputError, match=SENTENCE):
        VERBS[verb](tmp_path)
    assert not any(tmp_path.iterdir())


def returning(returned, **numbers) -> BlackBox:
    def program(time, inputs, given):
        return returned(time) if callable(returned) else returned

    return BlackBox("box", program, inputs=("u",), outputs=("y",), numbers=numbers)


def divided(time):
    return {"y": time / (1 // 0)}


RETURNED = {
    "nothing .*return missing.* mapping of y": (None, InputError),
    "returns 'list', but must return a mapping of y": ([1.0], InputError),
    "returns z, but its outputs are y": (lambda t: {"z": t}, InputError),
    "returns no output, but its outputs are y": ({}, InputError),
    r"shape \(2,\) for y, but must return \(3,\)": ({"y": np.zeros(2)}, InputError),
    "complex128 for y": (lambda t: {"y": t * 1j}, InputError),
    "nan for y at 0.02 s": (lambda t: {"y": np.where(t == 0.02, np.nan, t)}, DomainError),
    "cannot be computed": (divided, DomainError),
}


@pytest.mark.parametrize("sentence", RETURNED)
def test_what_a_program_must_not_return(sentence) -> None:
    returned, error = RETURNED[sentence]
    with pytest.raises(error, match=f"^box.*{sentence}"):
        simulate(returning(returned), {"u": np.zeros(3)}, RATE)


def boxed(**changed: object) -> object:
    stated = {"inputs": ("u",), "outputs": ("y",), "numbers": {"lag": 1.0}}
    return BlackBox("box", level_of, **{**stated, **changed})


REFUSED = {
    r"box: give its inputs as \('u',\)": lambda: boxed(inputs="u"),
    "box: its outputs are .*, but must be one name": lambda: boxed(outputs=()),
    "box: 'u' stands for two things": lambda: boxed(outputs=("u",)),
    "box: 'time' stands for two things": lambda: boxed(outputs=("time",)),
    "box: lag is 'long', but must be a finite": lambda: boxed(numbers={"lag": "long"}),
    "box has no input, output or number 'v'": lambda: boxed(
        definitions={"v": Definition("speed", "m/s")}
    ),
    "box: 3 cannot be called": lambda: BlackBox(
        "box", 3, inputs=("u",), outputs=("y",), numbers={}
    ),
    "tank has no input 'valv'; it has valve, bias": lambda: simulate(TANK, {"valv": ONES}, RATE),
    "tank needs the signal 'bias'": lambda: simulate(TANK, {"valve": ONES["valve"]}, RATE),
    "valve is 20 V at 0 s": lambda: simulate(TANK, {"valve": 20.0 + TIME, "bias": 0.0}, RATE),
    "tank .* steps of its own: leave out substeps": lambda: simulate(TANK, ONES, RATE, substeps=2),
    "tank .* leave out start": lambda: simulate(TANK, ONES, RATE, start="steady"),
    "tank .* leave out begin": lambda: simulate(TANK, ONES, RATE, begin={"level": 1.0}),
    "no limit 'high'; there are none": lambda: simulate(TANK, ONES, RATE).active("high"),
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_what_does_not_fit_a_black_box_is_refused(sentence) -> None:
    with pytest.raises(InputError, match=sentence):
        REFUSED[sentence]()
