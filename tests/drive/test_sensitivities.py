"""Whole trajectories' sensitivities against extrapolated differences, each limit active in turn."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from tests.drive.experiments import ALL, HARD, RATE, SWING
from tests.marks import rest_slow

from swashplate import Drive, InputError, Limit, Simulation, maneuvers
from swashplate.drive import ALL_COLUMNS
from swashplate.machine import Sensitivities


@dataclass(frozen=True)
class Scene:
    """A drive and a command under which one limit acts."""

    voltage: np.ndarray
    changes: dict = field(default_factory=dict)
    preset: str = "hoist"
    limit: Limit | None = None
    root: str = "published"
    decay: str = "sampled"
    rate: float | None = 512.0
    start: str = "rest"
    columns: tuple[str, ...] | None = None

    def drive(self) -> Drive:
        drive = Drive.preset(self.preset).replace(**self.changes)
        options = {"pressure_root": self.root, "card_switch": self.decay, "rate": self.rate}
        return Drive(replace(drive.parameters, **options))


SCENES = {
    "nothing but the dead zone": Scene(0.4 * SWING, limit=Limit.DEAD_ZONE),
    "current rate": Scene(HARD, limit=Limit.CURRENT_RATE),
    "decay from within a step": Scene(HARD, limit=Limit.CURRENT_RATE, decay="split"),
    "the filter's equation": Scene(HARD, {"C": 3.0}, rate=None),
    "orifice": Scene(2.5 * SWING, limit=Limit.ORIFICE),
    "spool stop": Scene(2.5 * SWING, {"Z14": 1.05e-4}, limit=Limit.SPOOL),
    "swash stop": Scene(HARD, {"Z16": 3e-4}, limit=Limit.SWASH_STOP),
    "relief valve": Scene(HARD, {"Z15": 3e5}, limit=Limit.RELIEF),
    "load": Scene(HARD, {"Z12": 0.3, "Z11": 0.02, "Z2": 0.005, "Z7": 0.2}),
    "physical root, leaking": Scene(2.0 * SWING, {"Z7": 0.5}, root="symmetric"),
    "steep": Scene(HARD, {"Z13": 0.6, "Z16": 6e-4}),
    "slew with its Coulomb term": Scene(2.5 * SWING, preset="slew"),
    "luff": Scene(HARD, preset="luff", limit=Limit.ORIFICE),
    "steady start": Scene(3.0 + SWING, start="steady"),
    "steady start, leaking": Scene(-3.0 + SWING, {"Z7": 0.5}, start="steady"),
}

# those of every refinement, and some of card and pump beside
REFINED = {**ALL, "cam_cycles": 5.4}
BESIDE = ("Z1", "Z8", "Z10", "Z16_plus", "G1_plus", "tau")
SLOWLY = 0.5 + maneuvers.sine(4.0, 0.8, start=0.05, length=2.0, settle=0.4).sample(RATE)
for title, left_out in (("all refinements", ()), ("all without the line", ("line_stiffness",))):
    some = {name: value for name, value in REFINED.items() if name not in left_out}
    SCENES[title] = Scene(SLOWLY, some, columns=(*some, *BESIDE))

# zero by the model's own equations: the filter's sign has no slope at C = 0 but the one-sided, and
# a negative value is not a valid parameter
ONE_SIDED = {"C_plus", "C_minus", "Z7", "I_t2_plus", "I_t2_minus", "Z6"}


def outputs(run: Simulation | Sensitivities) -> np.ndarray:
    names = ("current_positive", "current_negative", "shaft_speed", "shaft_position")
    return np.stack([run[name] for name in names])


def differences(scene: Scene, drive: Drive, name: str) -> list[np.ndarray]:
    """Derivatives of all outputs by one parameter, extrapolated, with several steps.

    No one step suits all samples: rounding spoils short ones, switches crossing a sample long ones.
    """
    value = drive.parameters.numbers[name]
    size = abs(value) or {"Z2": 1e-3, "Z18": 1e-5}.get(name, 1e-2)

    def at(offset: float) -> np.ndarray:
        changed = drive.replace(**{name: value + offset})
        return outputs(changed.simulate(scene.voltage, start=scene.start))

    found = []
    steps = (2e-6, 5e-5, 1e-3) if scene.columns is None else (2e-6, 2e-5, 2e-4)
    for h in (share * size for share in steps):
        if value == 0.0 and name in ONE_SIDED:
            found.append((-3.0 * at(0.0) + 4.0 * at(h) - at(2.0 * h)) / (2.0 * h))
        else:
            coarse = (at(h) - at(-h)) / (2.0 * h)
            fine = (at(0.5 * h) - at(-0.5 * h)) / h
            found.append((4.0 * fine - coarse) / 3.0)
    return found


@pytest.mark.parametrize("scene", rest_slow([*SCENES.values()], 2), ids=SCENES)
def test_every_parameter(scene: Scene) -> None:
    drive = scene.drive()
    by = drive.sensitivities(scene.voltage, start=scene.start, parameters=scene.columns)
    if scene.limit is not None:
        assert by.run.active(scene.limit).sum() > 20
    base = outputs(by.run)
    moved = set()
    whole = outputs(by)
    for j, name in enumerate(by.names):
        exact = whole[:, :, j]
        number = drive.parameters.numbers[name]
        if np.isinf(number) or (name.startswith("C_") and number == 0.0):
            continue
        found = differences(scene, drive, name)
        for signal in range(4):
            scale = np.abs(exact[signal]).max()
            noise = 1e-11 * np.abs(base[signal]).max() / abs(number or 1e-2)
            error = np.min([np.abs(each[signal] - exact[signal]) for each in found], axis=0)
            spoiled = error > 1e-5 * scale + noise
            most = 0.005 if scene.columns is None else 0.01  # refinements have more switches
            assert spoiled.mean() < most, (name, signal, error.max(), scale)
        moved |= {name} if np.abs(exact).max() > 0.0 else set()
    if scene.columns is not None:
        assert {*by.names} - moved <= {"motor_constant"}
    else:
        assert len(moved) > 25
    if scene.decay == "split":
        for name in ("I_t2_plus", "I_t2_minus"):
            assert np.abs(by["current"][:, by.names.index(name)]).max() > 0.05


@pytest.mark.traced
def test_coulomb_term_has_a_one_sided_derivative_at_zero(hoist: Drive) -> None:
    voltage = 2.0 * SWING
    by = hoist.sensitivities(voltage, parameters=["C"])
    e = 1e-4
    run, one = hoist.simulate(voltage), hoist.replace(C=(e, 0.0)).simulate(voltage)
    difference = (one.current_positive - run.current_positive) / e
    np.testing.assert_allclose(
        by["current_positive"][:, 0], difference, atol=2e-3 * np.abs(difference).max()
    )


@pytest.mark.parametrize("names", [[], "Z16"])
def test_a_list_of_names_is_needed(hoist: Drive, names) -> None:
    with pytest.raises(InputError, match="one parameter"):
        hoist.sensitivities([0.0], parameters=names)


@pytest.mark.traced
def test_columns_are_those_asked_for(hoist: Drive) -> None:
    voltage = 2.0 * SWING
    everything = hoist.sensitivities(voltage)
    assert everything.names == ALL_COLUMNS
    some = hoist.sensitivities(voltage, parameters=["tau", "Z16", "G1_minus"])
    assert some.names == ("tau", "Z16_plus", "Z16_minus", "G1_minus")
    for j, name in enumerate(some.names):
        k = everything.names.index(name)
        for signal in ("shaft_speed", "shaft_position", "current"):
            # not to the last bit: what is multiplied first depends on all columns
            column = everything[signal][:, k]
            error = np.abs(some[signal][:, j] - column).max()
            assert error <= 1e-12 * np.abs(column).max()


@pytest.mark.traced
def test_other_rates_have_sensitivities_at_their_own_samples(
    hoist: Drive, derivative: Callable[..., float]
) -> None:
    voltage = maneuvers.sine(3.0, 0.8, start=0.1, length=3.0, settle=0.4).sample(100.0)
    by = hoist.sensitivities(voltage, 100.0, parameters=["Z10", "omega_plus"])
    assert by["shaft_position"].shape == (voltage.size, 2)

    def last(omega: float) -> float:
        return float(hoist.replace(omega_plus=omega).simulate(voltage, 100.0).shaft_position[-1])

    omega = hoist["omega"].value.plus
    assert by["shaft_position"][-1, 1] == pytest.approx(
        derivative(last, [omega], 0, 1e-3), rel=1e-5
    )
    run = hoist.simulate(voltage, 100.0)
    assert by["shaft_speed"][:, 0] == pytest.approx(run.swash_angle, rel=1e-12, abs=1e-15)
