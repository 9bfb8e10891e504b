"""FMUs in importers that are not FMPy, beside the package: largest difference of each output.

    python -m venv importers
    importers/bin/pip install libcosimpy ecospy tbb
    python benchmarks/importers.py importers/bin/python

The importers run in an environment of their own, in which the package need not be: this file calls
itself there. What is missing there is skipped. Each is given the inputs of a run of the package,
one sample after the other, and reads all outputs after each step.
"""

import json
import subprocess
import sys
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree as ET

Rows = list[list[float]]

STEP = 1.0 / 512.0
"""Of the FMUs and of the importers. [s]"""
SECONDS = 20.0
"""Length of a run."""


class Task:
    """What an importer does: inputs by name, each with its samples, and the outputs to read."""

    def __init__(self, fmu: str, inputs: Mapping[str, list[float]], outputs: list[str]) -> None:
        self.fmu, self.inputs, self.outputs = fmu, inputs, outputs
        self.samples = len(next(iter(inputs.values())))

    def at(self, sample: int) -> list[float]:
        """All inputs at a sample."""
        return [values[sample] for values in self.inputs.values()]


# --- in the importers' environment: nothing of the package ----------------------------------------


def with_libcosim(task: Task) -> Rows:
    """Outputs after each step in libcosim (Open Simulation Platform): a row a step."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    execution = CosimExecution.from_step_size(STEP * 1e9)
    slave = execution.add_local_slave(CosimLocalSlave(task.fmu, "unit"))
    override, observer = CosimManipulator.create_override(), CosimObserver.create_last_value()
    execution.add_manipulator(override)
    execution.add_observer(observer)
    references = references_of(task.fmu)
    inputs = [references[name] for name in task.inputs]
    outputs = [references[name] for name in task.outputs]
    rows = []
    for sample in range(task.samples):
        override.slave_real_values(slave, inputs, task.at(sample))
        if not execution.step():
            raise RuntimeError(f"libcosim's step {sample} failed")
        rows.append(list(observer.last_real_values(slave, outputs)))
    return rows


def with_ecos(task: Task) -> Rows:
    """Outputs after each step in ecos."""
    load_tbb()
    from ecospy import EcosSimulation, EcosSimulationStructure

    with EcosSimulationStructure() as structure:
        structure.add_model("unit", task.fmu)
        simulation = EcosSimulation(STEP, structure=structure)
    with simulation:
        if not simulation.init():
            raise RuntimeError("ecos did not initialise the FMU")
        rows = []
        for sample in range(task.samples):
            for name, value in zip(task.inputs, task.at(sample), strict=True):
                simulation.set_real(f"unit::{name}", value)
            simulation.step()
            rows.append([simulation.get_real(f"unit::{name}") for name in task.outputs])
        simulation.terminate()
    return rows


def load_tbb() -> None:
    """Load the library that ecos is linked with, of the package tbb."""
    from ctypes import CDLL, RTLD_GLOBAL

    for path in sorted(Path(sys.prefix, "lib").glob("libhwloc.so.15")):
        CDLL(str(path), RTLD_GLOBAL)
    for path in sorted(Path(sys.prefix, "lib").glob("libtbb.so.12")):
        CDLL(str(path), RTLD_GLOBAL)


IMPORTERS: dict[str, tuple[str, Callable[[Task], Rows]]] = {
    "libcosim": ("libcosimpy", with_libcosim),
    "ecos": ("ecospy", with_ecos),
}
"""By name: the package that has it, and what runs a task."""


def references_of(fmu: str) -> dict[str, int]:
    """Value references of an FMU's variables by name."""
    with zipfile.ZipFile(fmu) as archive:
        root = ET.fromstring(archive.read("modelDescription.xml"))
    variables = root.find("ModelVariables")
    assert variables is not None
    return {each.attrib["name"]: int(each.attrib["valueReference"]) for each in variables}


def work(importer: str, folder: Path) -> None:
    """Do a task with an importer and leave what it gave."""
    from importlib.metadata import version

    package, run = IMPORTERS[importer]
    task = Task(**json.loads((folder / "task.json").read_text("utf-8")))
    given = {"version": version(package), "rows": run(task)}
    (folder / "given.json").write_text(json.dumps(given), "utf-8")


# --- beside the package ---------------------------------------------------------------------------


def drive_task(folder: Path, fmi: str) -> tuple[Task, Rows]:
    """A drive under steps of its voltage, and its numbers."""
    from swashplate import Drive, export, simulate

    hoist = Drive.preset("hoist")
    path = export.fmu(hoist, folder / "drive.fmu", fmi=fmi, platforms=["linux64"])
    outputs = outputs_of(path)
    count = round(SECONDS / STEP)
    volts = [9.0 if n < count // 3 else (-4.0 if n < 2 * count // 3 else 0.0) for n in range(count)]
    run = simulate(hoist, {"voltage": volts}, 1.0 / STEP, interpolation="previous")
    return Task(str(path), {"voltage": volts}, outputs), rows_of(run, outputs, count)


def crane_task(folder: Path, fmi: str, sea: str | None = None) -> tuple[Task, Rows]:
    """The packaged crane under the voltages of `crane run` in open loop, and the run's numbers."""
    import numpy as np

    from swashplate import export, simulate
    from swashplate.crane import Crane, OperatorCommand, Seaway, plant
    from swashplate.crane import simulate as simulate_crane

    crane = Crane.preset("tg3637")
    command = OperatorCommand.trapezoid(
        hoist=-0.2, slew=1.0, luff=0.3, duration=0.5 * SECONDS, length=SECONDS
    )
    seaway = None if sea is None else Seaway(sea, seed=1)
    open_loop = simulate_crane(crane, command, sea=seaway, brake=False)
    machine = plant(crane, brake=False)
    path = export.fmu(machine, folder / "crane.fmu", fmi=fmi, platforms=["linux64"])
    outputs = outputs_of(path)
    volts = {
        f"{axis}.voltage": open_loop[f"voltage_{axis}"].tolist()
        for axis in ("hoist", "slew", "luff")
    }
    count = len(volts["hoist.voltage"])
    names = [name for name in machine.ports.external if name.startswith("body.")]
    motion = np.zeros((count, len(names)))
    motion[:] = open_loop.ship if seaway else 0.0
    ship = {name: motion[:, column].tolist() for column, name in enumerate(names)}
    run = simulate(machine, {**volts, **ship}, 1.0 / STEP, interpolation="previous")
    for name in ("load_x", "load_y", "load_z", "hook_x", "tip_z", "rope"):
        assert np.array_equal(run[f"body.{name}"], open_loop[name])  # as `crane run` has them
    return Task(str(path), {**volts, **ship}, outputs), rows_of(run, outputs, count)


def crane_at_sea(folder: Path, fmi: str) -> tuple[Task, Rows]:
    """The same on a ship in sea state 3, which its outputs follow at the same instant."""
    return crane_task(folder, fmi, "ss3")


def loop_task(folder: Path, fmi: str) -> tuple[Task, Rows]:
    """The packaged crane in closed loop under the stick of `crane run`, and the run's numbers."""
    import numpy as np

    from swashplate import export, simulate
    from swashplate.crane import Crane, OperatorCommand, control, controlled
    from swashplate.crane import simulate as simulate_crane

    crane = Crane.preset("tg3637")
    command = OperatorCommand.trapezoid(
        hoist=-0.2, slew=1.0, luff=0.3, duration=0.5 * SECONDS, length=SECONDS
    )
    damped = control.Chain((control.TipShaper("zv"), control.DelayedFeedback(), control.Clip()))
    closed_loop = simulate_crane(crane, command, control=damped, brake=False)
    machine = controlled(crane, control=damped, brake=False)
    path = export.fmu(machine, folder / "crane.fmu", fmi=fmi, platforms=["linux64"])
    outputs = outputs_of(path)
    stick = {
        f"stick.{axis}": column.tolist()
        for axis, column in zip(("hoist", "slew", "luff"), closed_loop.stick.T, strict=True)
    }
    run = simulate(machine, stick, 1.0 / STEP, interpolation="previous")
    for name in ("load_x", "load_y", "load_z", "hook_x", "tip_z", "rope"):
        assert np.array_equal(run[f"body.{name}"], closed_loop[name])  # as `crane run` has them
    return Task(str(path), stick, outputs), rows_of(run, outputs, len(closed_loop.stick))


def outputs_of(fmu: Path) -> list[str]:
    """Outputs of an FMU."""
    with zipfile.ZipFile(fmu) as archive:
        root = ET.fromstring(archive.read("modelDescription.xml"))
    variables = root.find("ModelVariables")
    assert variables is not None
    return [each.attrib["name"] for each in variables if each.attrib["causality"] == "output"]


def rows_of(run: Mapping[str, Sequence[float]], outputs: Sequence[str], count: int) -> Rows:
    """Outputs of a run after each step but the last: those of the sample behind it."""
    import numpy as np

    table = np.array([run[name] for name in outputs])
    return [table[:, n].tolist() for n in range(1, count)]


TASKS = {
    "drive hoist": drive_task,
    "crane tg3637": crane_task,
    "crane at sea": crane_at_sea,
    "crane in closed loop": loop_task,
}
FMI = ("2.0", "3.0")
SHOWN = ("body.tip_z", "body.load_x", "body.load_z", "hoist.shaft_speed", "luff.shaft_speed")
"""Outputs whose differences are shown if there are any."""


def compared(python: str, importer: str, what: str, fmi: str) -> str:
    """A line on what an importer gives of a task."""
    with TemporaryDirectory() as place:
        folder = Path(place)
        task, wanted = TASKS[what](folder, fmi)
        (folder / "task.json").write_text(json.dumps(vars_of(task)), "utf-8")
        words = [python, __file__, "--work", importer, str(folder)]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        if not (folder / "given.json").exists():
            last = (done.stderr.strip() or done.stdout.strip()).splitlines()[-1:]
            return f"{importer}, {what}, FMI {fmi}: not run: {' '.join(last)}"
        given = json.loads((folder / "given.json").read_text("utf-8"))
    differences = dict.fromkeys(task.outputs, 0.0)
    # a step more than there are samples behind one
    for row, right in zip(given["rows"][: len(wanted)], wanted, strict=True):
        for name, one, other in zip(task.outputs, row, right, strict=True):
            difference = abs(one - other)
            if not difference <= differences[name]:  # also one that is no number
                differences[name] = difference
    unequal = [name for name, size in differences.items() if size != 0.0]
    listed = [name for name in unequal if name in SHOWN] or unequal
    sizes = ", ".join(f"{name} within {differences[name]:.3g}" for name in listed)
    equal = f"{len(differences) - len(unequal)} of {len(differences)} outputs of equal bits"
    return (
        f"{importer} {given['version']}, {what}, FMI {fmi}: {len(wanted)} samples, {equal}"
        f"{': ' if sizes else ''}{sizes}"
    )


def vars_of(task: Task) -> dict[str, object]:
    """A task as JSON keeps it."""
    return {"fmu": task.fmu, "inputs": task.inputs, "outputs": task.outputs}


if __name__ == "__main__":
    if sys.argv[1:2] == ["--work"]:
        work(sys.argv[2], Path(sys.argv[3]))
        sys.stdout.flush()
    elif len(sys.argv) == 2:
        for each in IMPORTERS:
            for kind in TASKS:
                for version_of_fmi in FMI:
                    print(compared(sys.argv[1], each, kind, version_of_fmi), flush=True)
    else:
        print(__doc__)
        sys.exit(2)
