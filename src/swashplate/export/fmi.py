"""FMU of a drive or a model, FMI 2.0 or 3.0 for co-simulation: what it declares and carries.

Inside, the model runs on its own grid of samples, whatever the master's steps are. The library of a
drive is the package's own; the numbers are a resource that it reads.
"""

from __future__ import annotations

import re
import warnings
import zipfile
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any, Literal
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.__about__ import __version__
from swashplate.drive import Drive
from swashplate.errors import FileError, InputError
from swashplate.export.c_folder import (
    LONGEST_STEP,
    OWN_LICENCE,
    THIRD_PARTY,
    Content,
    content_of,
    licence_texts,
)
from swashplate.export.c_source import feedthrough, newest
from swashplate.export.libraries import (
    Platform,
    Sources,
    chosen_platforms,
    compiled_library,
    one_unit,
    packaged,
    sources,
)
from swashplate.export.variable_list import LONGEST_LINE, NONE, Variable, variables
from swashplate.machine import Machine, simulate
from swashplate.machine.fields import value_at
from swashplate.results import Result
from swashplate.tables import UNIT, Column, Table, write_bytes
from swashplate.units import si_exponents, to_si

Version = Literal["2.0", "3.0"]
Array = NDArray[np.float64]

MAGIC, RESOURCE_VERSION, TOKEN_LENGTH = b"SWPDRIVE", 1, 64
DISPLAYED = {"rad": ("deg",), "rad/s": ("deg/s", "rpm"), "Pa": ("bar",), "m": ("mm",), "s": ("ms",)}
"""Units that people read, offered in addition to SI ones."""
WHOLE = "fmu.c"
"""The source that an importer compiles."""
COPYRIGHT = "Libraries and sources: the swashplate developers; numbers: their owner"
LICENSE = "Libraries and sources: BSD-3-Clause; numbers: as their owner says"
"""Of an FMU; who wrote it down is not known, so that it names no author."""
ABILITIES_2 = (
    "canInterpolateInputs",
    "canGetAndSetFMUstate",
    "canSerializeFMUstate",
    "canNotUseMemoryManagementFunctions",
)
ABILITIES_3 = ("canGetAndSetFMUState", "canSerializeFMUState")
SHORTEST_STEP_INSTEAD = 0.1
"""Of the step, the shortest one that is proposed in its place: a delay that would need a shorter
one, such as a fitted delay that ended at its lower bound, is practically none. [1]"""
_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_EARLIEST = (1980, 1, 1, 0, 0, 0)


def fmu(
    what: Drive | Machine,
    path: str | Path,
    *,
    fmi: Version = "2.0",
    step: float = LONGEST_STEP,
    platforms: Sequence[str] | None = None,
) -> Path:
    """Write a drive, or a machine, as an FMU for co-simulation.

    Parameters
    ----------
    what : Drive or Machine
        Whose numbers and forms are the start values. A drive with a user-defined equation, or a
        machine, is compiled, which needs a compiler (extra ``binaries``).
    path : path
        The file, ``.fmu``; an older one is replaced.
    fmi : {"2.0", "3.0"}
        Version of the standard.
    step : float
        Step of its own grid, of a drive at most 1/512 s; the master's step may be any. [s]
    platforms : sequence of str, optional
        Of ``"linux64"``, ``"aarch64-linux"``, ``"win64"`` and ``"darwin64"``; by default all, or
        this machine where a C compiler is all that there is.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        For an option that there is not, a step that the card's filter does not allow, a delay that
        is longer than the library's line, or a compiler that is missing.
    EquationError
        If an equation has no counterpart in C.
    FileError
        If the file cannot be written.

    Warns
    -----
    UserWarning
        Where a delay is so short that outputs depend on an input of their own instant (of a drive's
        voltage 1.5 steps), and a master that does not set it before it reads them is a sample
        behind; where the recursion of the card's filter was converted to another step.

    Examples
    --------
    >>> from swashplate import Drive, export
    >>> export.fmu(Drive.preset("hoist"), "hoist.fmu").name
    'hoist.fmu'
    """
    if fmi not in ("2.0", "3.0"):
        raise InputError(f"fmi is '{fmi}'; it is '2.0' or '3.0'.")
    if Path(path).suffix.lower() != ".fmu":
        raise InputError(f"{path} must end in .fmu, as importers know it.")
    chosen_platforms(platforms)
    content = exportable(what, step)
    write_bytes(packed(content, fmi, chosen_platforms(platforms, not content.packaged)), path)
    return Path(path)


def exportable(what: Drive | Machine, step: float) -> Content:
    """What runs at a step, its delays checked; see `content_of`."""
    content = content_of(what, step)
    for part_index, _, _, tap, _ in content.exported.windows:
        delay = value_at(content.machine.parts[part_index].p, tap.delay) if tap.delay else 0.0
        if delay > LONGEST_LINE * step:
            raise InputError(
                f"{what.name}: {tap.delay} is {delay:g} s, but the library's line holds "
                f"{LONGEST_LINE} steps, {LONGEST_LINE * step:g} s; choose a step of "
                f"{delay / LONGEST_LINE:.3g} s or more."
            )
    for signal, (delay, steps) in newest(content.exported, content.machine, step).items():
        enough = delay / steps
        advice = "a master that sets inputs before it reads outputs gets them exactly"
        if enough >= SHORTEST_STEP_INSTEAD * step:
            advice = f"choose a step of {enough:.3g} s or less"
        warnings.warn(
            f"{what.name}: the delay of the {signal} is {delay:g} s, below {steps:g} steps of "
            f"{step:g} s, so that outputs depend on the {signal} at the same instant and may be "
            f"one sample late; {advice}.",
            stacklevel=3,
        )
    return content


def packed(content: Content, fmi: Version, platforms: Collection[Platform]) -> bytes:
    """The file's content: the same bytes for the same drive and options."""
    source_files, table, name = sources(content), table_of(content), content.identifier
    numbers = np.where(np.isinf(content.values), np.copysign(NONE, content.values), content.values)
    token = _token(fmi, source_files, numbers, table)
    members = {
        "modelDescription.xml": description(content, table, fmi, token),
        "resources/drive.bin": resource(numbers, source_files.layout, token),
        f"sources/{WHOLE}": one_unit(source_files, fmi, name).encode(),
    }
    unused = ("wasm.c", "fmi3.c" if fmi == "2.0" else "fmi2.c")
    members |= {
        f"sources/{file}": text.encode()
        for file, text in source_files.texts.items()
        if file not in unused
    }
    if fmi == "3.0":
        members["sources/buildDescription.xml"] = _build_description(name)
    # both standards begin at license.txt and leave the other names free
    texts = licence_texts()
    members["documentation/licenses/license.txt"] = texts[OWN_LICENCE].encode()
    members[f"documentation/licenses/{THIRD_PARTY}"] = texts[THIRD_PARTY].encode()
    for platform in platforms:
        library = (
            packaged(platform.library)
            if content.packaged
            else compiled_library(source_files, platform)
        )
        for folder in platform.fmi2 if fmi == "2.0" else platform.fmi3:
            members[f"binaries/{folder}/{name}{platform.ending}"] = library
    return _zipped(members)


def table_of(content: Content) -> tuple[Variable, ...]:
    """Every variable of what is exported."""
    direct = feedthrough(content.exported, content.machine, content.step)
    values = content.values.tolist()
    return variables(content.exported, values, direct, content.descriptions, content.references)


def resource(numbers: Array, layout: int, token: str) -> bytes:
    """``drive.bin``: magic, version, count, layout, token, then little-endian doubles."""
    head = MAGIC + RESOURCE_VERSION.to_bytes(4, "little") + len(numbers).to_bytes(4, "little")
    head += layout.to_bytes(8, "little") + token.encode().ljust(TOKEN_LENGTH, b"\0")
    return head + numbers.astype("<f8").tobytes()


def _token(fmi: Version, sources: Sources, numbers: Array, table: Sequence[Variable]) -> str:
    """GUID made of the sources, the numbers and the variables."""
    digest = sha256(f"{fmi} {__version__}".encode())
    for name in sorted(sources.texts):
        digest.update(sources.texts[name].encode())
    digest.update(numbers.astype("<f8").tobytes())
    digest.update(
        repr([(variable.name, variable.reference, variable.start) for variable in table]).encode()
    )
    digits = digest.hexdigest()
    return f"{{{digits[:8]}-{digits[8:12]}-{digits[12:16]}-{digits[16:20]}-{digits[20:32]}}}"


def _zipped(members: Mapping[str, bytes]) -> bytes:
    """A zip whose bytes depend only on its content, the description first."""
    target = BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name in sorted(members, key=lambda member: (member != "modelDescription.xml", member)):
            entry = zipfile.ZipInfo(name, _EARLIEST)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3
            entry.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            archive.writestr(entry, members[name])
    return target.getvalue()


def _xml(root: ET.Element) -> bytes:
    """A document's bytes, without the characters that XML cannot have."""
    for element in root.iter():
        for name, value in element.attrib.items():
            element.set(name, _NOT_XML.sub("\N{REPLACEMENT CHARACTER}", value))
    ET.indent(root)
    text = ET.tostring(root, "unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


# --- modelDescription.xml -------------------------------------------------------------------------


def description(content: Content, table: Sequence[Variable], fmi: Version, token: str) -> bytes:
    """``modelDescription.xml``."""
    root = ET.Element("fmiModelDescription", _head(content, table, fmi, token))
    step, two = repr(content.step), fmi == "2.0"
    abilities = ["canHandleVariableCommunicationStepSize", *(ABILITIES_2 if two else ABILITIES_3)]
    interface = {"modelIdentifier": content.identifier, **dict.fromkeys(abilities, "true")}
    slave = ET.SubElement(
        root, "CoSimulation", interface if two else {**interface, "fixedInternalStepSize": step}
    )
    if two:
        ET.SubElement(ET.SubElement(slave, "SourceFiles"), "File", {"name": WHOLE})
    _add_units(root, table)
    categories = ET.SubElement(root, "LogCategories")
    for name in ("logStatusWarning", "logStatusDiscard", "logStatusError"):
        ET.SubElement(categories, "Category", {"name": name})
    span = {"startTime": "0", "stopTime": "10", "stepSize": step}
    ET.SubElement(root, "DefaultExperiment", span)
    listed = ET.SubElement(root, "ModelVariables")
    for variable in table:
        flag = isinstance(variable.start, bool)
        initial = {"start": str(variable.start).lower()} if flag else _number(variable)
        if two:
            scalar = ET.SubElement(listed, "ScalarVariable", _attributes(variable))
            ET.SubElement(scalar, "Boolean" if flag else "Real", initial)
        else:
            ET.SubElement(
                listed, "Boolean" if flag else "Float64", {**_attributes(variable), **initial}
            )
    if not two:
        clock = {"name": "time", "valueReference": str(content.references.TIME)}
        clock |= {"causality": "independent", "variability": "continuous", "unit": "s"}
        ET.SubElement(listed, "Float64", clock)
    _add_structure(ET.SubElement(root, "ModelStructure"), table, two)
    return _xml(root)


def _head(content: Content, table: Sequence[Variable], fmi: Version, token: str) -> dict[str, str]:
    title = content.machine.title or f"Model {content.name}"
    description = f"{title}. Own steps of {content.step:g} s."
    read = sorted({name for variable in table for name in variable.feedthrough})
    if read:
        description += (
            f" Some outputs depend on {', '.join(read)} at the same instant: a master that reads "
            "them before it has set that input sees them one step late."
        )
    named = "guid" if fmi == "2.0" else "instantiationToken"
    return {
        "fmiVersion": fmi,
        "modelName": content.name,
        named: token,
        "description": description,
        "copyright": COPYRIGHT,
        "license": LICENSE,
        "generationTool": f"swashplate {__version__}",
        "variableNamingConvention": "structured",
    }


def _attributes(variable: Variable) -> dict[str, str]:
    attributes = {
        "name": variable.name,
        "valueReference": str(variable.reference),
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
    }
    if variable.causality == "parameter":
        attributes["initial"] = "exact"
    return attributes


def _number(variable: Variable) -> dict[str, str]:
    attributes = {"unit": variable.unit} if variable.unit != "1" else {}
    if variable.unit in DISPLAYED:
        attributes["displayUnit"] = DISPLAYED[variable.unit][0]
    if variable.lower is not None:
        attributes["min"] = repr(variable.lower)
    if variable.upper is not None:
        attributes["max"] = repr(variable.upper)
    if variable.start is not None:
        attributes["start"] = repr(variable.start)
    return attributes


def _add_structure(structure: ET.Element, table: Sequence[Variable], two: bool) -> None:
    """Outputs with the inputs that they follow instantaneously; in FMI 2 by number in the table."""
    numbers = {
        variable.name: index if two else variable.reference
        for index, variable in enumerate(table, 1)
    }
    key = "index" if two else "valueReference"
    names = [variable for variable in table if variable.causality == "output"]
    listed, initial = structure, structure
    if two:
        listed, initial = (ET.SubElement(structure, tag) for tag in ("Outputs", "InitialUnknowns"))
    for output in names:
        read = sorted(numbers[name] for name in output.feedthrough)
        dependency = {key: str(numbers[output.name]), "dependencies": " ".join(map(str, read))}
        dependency["dependenciesKind"] = " ".join("dependent" for _ in read)
        ET.SubElement(listed, "Unknown" if two else "Output", dependency)
    for name in names:
        entry = {key: str(numbers[name.name])}
        ET.SubElement(initial, "Unknown" if two else "InitialUnknown", entry)


def _build_description(identifier: str) -> bytes:
    root = ET.Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    build = ET.SubElement(root, "BuildConfiguration", {"modelIdentifier": identifier})
    settings = {"language": "C11", "compilerOptions": "-ffp-contract=off"}
    ET.SubElement(ET.SubElement(build, "SourceFileSet", settings), "SourceFile", {"name": WHOLE})
    return _xml(root)


def _add_units(root: ET.Element, table: Sequence[Variable]) -> None:
    definitions = ET.SubElement(root, "UnitDefinitions")
    for unit in sorted({variable.unit for variable in table if variable.unit != "1"} | {"s"}):
        element = ET.SubElement(definitions, "Unit", {"name": unit})
        exponents = si_exponents(unit)
        if exponents is not None:  # FMI cannot say fractions
            ET.SubElement(
                element, "BaseUnit", {name: str(exponent) for name, exponent in exponents.items()}
            )
        for display_unit in DISPLAYED.get(unit, ()):
            factor = 1.0 / to_si(1.0, display_unit, unit, "a display unit")
            ET.SubElement(element, "DisplayUnit", {"name": display_unit, "factor": repr(factor)})


# --- comparison -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class FmuComparison(Result):
    """An FMU's outputs and those of its machine, sample by sample."""

    name: str
    """Name of the machine."""
    samples: int
    differences: Mapping[str, float]
    """Largest difference of each output, SI."""
    units: Mapping[str, str]
    """SI unit of each output."""

    @property
    def equal(self) -> bool:
        """Whether every number is equal to the last bit."""
        return not any(self.differences.values())

    def tables(self) -> list[Table]:
        """Largest difference of each output."""
        columns = (Column("output"), Column("largest difference", ".3g"), UNIT)
        table = Table(f"FMU of {self.name} against the machine, {self.samples} samples", columns)
        for name, difference in self.differences.items():
            table.add(name, difference, unit=self.units[name], look=difference != 0.0)
        return [table]


def compare(
    path: str | Path, machine: Machine, inputs: ArrayLike | Mapping[str, ArrayLike]
) -> FmuComparison:
    """Run an FMU with FMPy and compare it with its machine, at the FMU's own step.

    Parameters
    ----------
    path : path
        The FMU.
    machine : Machine
        That it was made of, a `Drive` for example.
    inputs : (n,) array_like, or mapping of str to (n,) array_like
        The first input, a drive's voltage, at each step of the FMU; or several by name. SI.

    Returns
    -------
    FmuComparison
        Largest differences, 0 if the FMU's numbers are the machine's.

    Raises
    ------
    InputError
        If FMPy is not installed, inputs do not fit, or the FMU fails.
    FileError
        If the file is no FMU.
    """
    if not isinstance(machine, Machine):
        raise InputError(f"An FMU is compared with a Drive or a Machine, not with {machine!r}.")
    try:
        import fmpy
    except ImportError:
        raise InputError(
            "Comparing needs FMPy: install the extra fmu (pip install 'swashplate[fmu]')."
        ) from None
    step = _step_of(Path(path), fmpy)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # said when it was exported
        content = exportable(machine, step)
    if not isinstance(inputs, Mapping):
        inputs = {content.machine.model.external[0]: inputs}
    run = simulate(content.machine, inputs, 1.0 / step, interpolation="previous")
    samples = run.time.size
    if samples < 2:
        raise InputError("Inputs to compare by need at least two samples.")
    table = table_of(content)
    starts = {variable.name: variable.start for variable in table if variable.causality == "input"}
    records = {name: record.values for name, record in run.records.items()}
    columns = {"time": np.arange(samples) * step, **starts, **records}
    signals = np.empty(samples, [(name, np.float64) for name in columns])
    for name, values in columns.items():
        signals[name] = values
    names = [variable.name for variable in table if variable.causality == "output"]
    try:
        outputs = fmpy.simulate_fmu(
            str(path),
            start_time=0.0,
            stop_time=float(signals["time"][-1]),
            output_interval=step,
            input=signals,
            output=names,
        )
    except Exception as error:
        raise InputError(f"{path} fails: {error}") from None
    if len(outputs) != samples:
        raise InputError(f"{path} gave {len(outputs)} samples for inputs of {samples}.")
    differences = {name: float(np.abs(outputs[name] - run[name]).max()) for name in names}
    units = {variable.name: variable.unit for variable in table}
    return FmuComparison(run.name, samples, differences, units)


def _step_of(path: Path, fmpy: Any) -> float:
    """The own step that an FMU declares. [s]"""
    try:
        described = fmpy.read_model_description(str(path), validate=False)
        (step,) = [variable for variable in described.modelVariables if variable.name == "step"]
        return float(step.start)
    except Exception:
        raise FileError(f"{path} is not an FMU of swashplate.") from None
