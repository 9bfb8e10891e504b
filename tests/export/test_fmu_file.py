"""FMUs as files: what they declare and carry, and what cannot be exported."""

import csv
import re
import shutil
import subprocess
import sys
import warnings
import zipfile
from ctypes import CDLL
from dataclasses import replace
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from tests.marks import rest_slow

from swashplate import DomainError, Drive, FileError, InputError, export
from swashplate.export import libraries
from swashplate.machine import Definition, equation
from swashplate.models.displacement_control import Pump, stopped_spool

fmpy = pytest.importorskip("fmpy")
from fmpy.validation import validate_fmu  # noqa: E402

HERE = Path(__file__).parent
HEADERS = Path(fmpy.__file__).parent / "c-code"


class Seal(NamedTuple):
    """A seal of the spool."""

    seal_loss: Annotated[float, Definition("share of the stroke lost", "1", lower=0.0)] = 0.0


@equation
def sealed_spool(position: float, p: Pump, seal_loss: float) -> float:
    """The package's position of the spool less what the seal takes."""
    return min(max(position, -p.Z14), p.Z14) * (1.0 - seal_loss)


LINUX = sys.platform == "linux" and fmpy.platform == "linux64"


@pytest.fixture(params=["2.0", "3.0"])
def fmi(request):
    return request.param


@pytest.fixture(scope="session")
def files(tmp_path_factory):
    """An FMU of the hoist for each version of the standard."""
    folder = tmp_path_factory.mktemp("fmus")
    hoist = Drive.preset("hoist")
    return {
        version: export.fmu(hoist, folder / f"hoist{version[0]}.fmu", fmi=version)
        for version in ("2.0", "3.0")
    }


def described(path: Path) -> ET.Element:
    with zipfile.ZipFile(path) as opened:
        return ET.fromstring(opened.read("modelDescription.xml"))


def start_of(root: ET.Element, name: str) -> str | None:
    (found,) = [each for each in root.iter() if each.get("name") == name and each.get("causality")]
    return (found if found.get("start") else found[0]).get("start")


@pytest.mark.parametrize("axis", rest_slow(["hoist", "slew", "luff", "neutral"]))
@pytest.mark.filterwarnings("ignore:neutral")  # it has no delay
def test_validators_find_nothing(axis, fmi, tmp_path):
    path = export.fmu(Drive.preset(axis), tmp_path / "a.fmu", fmi=fmi, platforms=["linux64"])
    assert validate_fmu(str(path)) == []
    read = fmpy.read_model_description(str(path))  # against the schema, too
    assert read.fmiVersion == fmi
    assert read.coSimulation.canGetAndSetFMUstate
    assert read.coSimulation.canSerializeFMUstate
    assert read.coSimulation.canHandleVariableCommunicationStepSize
    assert "BSD-3-Clause" in read.license
    assert "swashplate developers" in read.copyright
    text = zipfile.ZipFile(path).read("modelDescription.xml").decode()
    assert not re.search(r'"[+-]?(inf|nan)', text, re.IGNORECASE)


def test_value_references_never_change(files, fmi):
    with (HERE / "value_references.csv").open(encoding="utf-8") as opened:
        stored = {name: int(reference) for name, reference in csv.reader(opened)}
    read = fmpy.read_model_description(str(files[fmi]))
    found = {each.name: each.valueReference for each in read.modelVariables}
    assert {name: found.get(name) for name in stored if name != "time" or fmi == "3.0"} == {
        name: value for name, value in stored.items() if name != "time" or fmi == "3.0"
    }
    assert set(found) <= set(stored), "store the value references of new variables"


def test_variables_have_units_ranges_and_words(files, fmi, hoist):
    read = fmpy.read_model_description(str(files[fmi]))
    by_name = {each.name: each for each in read.modelVariables}
    speed, opening = by_name["shaft_speed"], by_name["Z16_plus"]
    assert (speed.causality, speed.unit, speed.displayUnit) == ("output", "rad/s", "deg/s")
    assert (opening.causality, opening.variability, opening.unit) == ("parameter", "tunable", "m")
    assert float(opening.start) == hoist["Z16"].value.plus
    assert (float(opening.min), float(opening.max)) == (0.0, 1e30)
    assert "orifice limits the flow, plus direction" in opening.description
    assert all(each.description for each in read.modelVariables if each.causality != "independent")
    inputs = [each.name for each in read.modelVariables if each.causality == "input"]
    assert inputs == ["voltage", "pump_speed", "load_torque", "supply_pressure"]
    assert float(by_name["supply_pressure"].start) == hoist["Z9"].value
    assert by_name["start_steady"].variability == "fixed"
    # every value that a set has is there, but for the load's torque, which is an input
    assert set(hoist.parameters.numbers) <= set(by_name)


def test_units_are_made_of_base_units(files, fmi):
    root = described(files[fmi])
    base = {
        each.get("name"): None if each.find("BaseUnit") is None else each.find("BaseUnit").attrib
        for each in root.iter("Unit")
    }
    assert base["Pa"] == {"kg": "1", "m": "-1", "s": "-2"}
    assert base["N m/rad"] == {"kg": "1", "m": "2", "s": "-2", "rad": "-1"}
    assert base["A/V^2"] == {"kg": "-2", "m": "-4", "s": "6", "A": "3"}
    assert base["sqrt(Pa)/(m s)"] is None  # a half power, which FMI cannot say
    shown = {each.get("name"): float(each.get("factor")) for each in root.iter("DisplayUnit")}
    assert shown == pytest.approx(
        {"deg": 180 / np.pi, "deg/s": 180 / np.pi, "rpm": 30 / np.pi, "bar": 1e-5, "mm": 1e3}
        | {"ms": 1e3}
    )


def test_outputs_say_what_they_follow_at_once(files, fmi):
    read = fmpy.read_model_description(str(files[fmi]))
    found = {
        each.variable.name: {other.name for other in each.dependencies} for each in read.outputs
    }
    assert len(found) == 12
    motor = {"pump_speed", "load_torque", "supply_pressure"}  # of a rigid load, through its speed
    known = {"shaft_speed": {"pump_speed"}, "shaft_position": {"pump_speed"}}
    known |= {"motor_torque": motor, "motor_pressure_drop": motor}
    assert found == {name: known.get(name, set()) for name in found}


def test_outputs_follow_the_voltage_at_once_without_a_delay(tmp_path, fmi):
    with pytest.warns(UserWarning, match=r"neutral: the delay of the voltage is 0 s, .* 1.5 steps"):
        path = export.fmu(Drive.preset("neutral"), tmp_path / "n.fmu", fmi=fmi)
    read = fmpy.read_model_description(str(path))
    follow = {
        e.variable.name for e in read.outputs if "voltage" in {d.name for d in e.dependencies}
    }
    states = {"stroker_pressure", "swash_angle", "shaft_speed", "shaft_position"}
    assert follow == {each.variable.name for each in read.outputs} - states
    assert re.search(r"depend on .*voltage at the same instant", read.description)


def test_a_short_delay_is_warned_of_with_a_step_that_would_do(hoist, tmp_path):
    short = hoist.replace(tau=2.4e-3)
    with pytest.warns(UserWarning, match=r"step of 0.0016 s"):
        export.fmu(short, tmp_path / "a.fmu", platforms=["linux64"])
    exact = short.at_every_rate()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        export.fmu(exact, tmp_path / "a.fmu", step=1.6e-3, platforms=["linux64"])


@pytest.mark.parametrize("tau", [0.0, 6.6e-12, 1e-7, 2e-5])
def test_no_step_is_proposed_for_a_delay_that_is_practically_none(hoist, tmp_path, tau):
    """A fitted delay at its lower bound is no reason to step in picoseconds."""
    with pytest.warns(UserWarning, match="sets inputs before it reads outputs") as warned:
        export.fmu(hoist.replace(tau=tau), tmp_path / "a.fmu", platforms=["linux64"])
    assert not any("choose a step" in str(each.message) for each in warned)


def test_same_drive_same_bytes_and_another_another_token(hoist, files, fmi, tmp_path):
    again = export.fmu(hoist, tmp_path / "other.fmu", fmi=fmi)
    assert again.read_bytes() == files[fmi].read_bytes()
    with zipfile.ZipFile(again) as opened:
        names = opened.namelist()
        assert {each.date_time for each in opened.infolist()} == {(1980, 1, 1, 0, 0, 0)}
    assert names[0] == "modelDescription.xml"
    assert names[1:] == sorted(names[1:])
    changed = export.fmu(hoist.replace(Z10=12.0), tmp_path / "a.fmu", fmi=fmi)
    named = "guid" if fmi == "2.0" else "instantiationToken"
    one, two = (described(path).get(named) for path in (again, changed))
    assert re.fullmatch(r"\{[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}\}", one)
    assert one != two


def test_carries_every_platform_under_every_name(files, fmi):
    names = zipfile.ZipFile(files[fmi]).namelist()
    found = {each.split("/")[1] for each in names if each.startswith("binaries/")}
    if fmi == "2.0":
        assert found == {"linux64", "win64", "darwin64", "aarch64-darwin", "aarch64-linux"}
    else:
        machines = {"x86_64-linux", "aarch64-linux", "x86_64-windows"}
        assert found == machines | {"x86_64-darwin", "aarch64-darwin"}


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("cc"), reason="there is no C compiler")
@pytest.mark.skipif(not LINUX, reason="the importer would take another folder")
def test_sources_inside_make_the_same_library(files, fmi, hoist, tmp_path):
    folder = Path(fmpy.extract(str(files[fmi]), unzipdir=str(tmp_path / "unpacked")))
    root, sources = described(files[fmi]), folder / "sources"
    if fmi == "2.0":
        units = [each.get("name") for each in root.iter("File")]
    else:
        build = ET.parse(sources / "buildDescription.xml").getroot()
        units = [each.get("name") for each in build.iter("SourceFile")]
    machine = "linux64" if fmi == "2.0" else "x86_64-linux"
    library = folder / "binaries" / machine / "hoist.so"
    words = ["cc", "-std=c99", "-O1", "-ffp-contract=off", "-shared", "-fPIC", f"-I{HEADERS}",
             "-Wall", "-Wextra", "-Werror", "-DFMI3_OVERRIDE_FUNCTION_PREFIX"]  # fmt: skip
    subprocess.run([*words, *units, "-lm", "-o", library], cwd=sources, check=True)
    packed = tmp_path / "again.fmu"
    with zipfile.ZipFile(packed, "w") as made:
        for each in folder.rglob("*"):
            made.write(each, each.relative_to(folder))
    voltage = 8.0 * np.sin(np.arange(600) / 60.0)
    assert export.compare(packed, hoist, voltage).equal


@pytest.mark.slow
@pytest.mark.skipif(not (shutil.which("cc") and shutil.which("nm")), reason="there is no compiler")
def test_functions_of_several_sources_have_names_of_their_own(hoist, fmi, tmp_path):
    """So that a program can link the sources of several drives."""
    path = export.fmu(hoist, tmp_path / "a.fmu", fmi=fmi, platforms=["linux64"])
    sources = Path(fmpy.extract(str(path), unzipdir=str(tmp_path / "unpacked"))) / "sources"
    shutil.copytree(HEADERS, tmp_path / "include")
    text = (HEADERS / "fmi2Functions.h").read_text("utf-8")
    (tmp_path / "include" / "fmi2Functions.h").write_text(
        text.replace("#define fmi2FullName(name) name", PREFIXED), "utf-8"
    )
    words = ["cc", "-std=c99", "-O1", f"-I{tmp_path / 'include'}", "-c", "fmu.c", "-o", "fmu.o"]
    subprocess.run(words, cwd=sources, check=True)
    listed = subprocess.run(
        ["nm", "-g", "--defined-only", "fmu.o"], cwd=sources, capture_output=True, text=True
    )
    seen = listed.stdout.split()[2::3]
    assert len(seen) == len(exported_by(f"fmi{fmi[0]}Functions.h"))
    assert all(each.startswith(f"hoist_fmi{fmi[0]}") for each in seen)


PREFIXED = """
#define fmi2Paste(a, b) a##b
#define fmi2PasteB(a, b) fmi2Paste(a, b)
#define fmi2FullName(name) fmi2PasteB(FMI2_FUNCTION_PREFIX, name)
"""
"""The standard's header has these lines, in place of which FMPy's always has no prefix."""


# --- libraries ------------------------------------------------------------------------------------


def test_libraries_are_of_the_present_sources():
    """After a change of equations or C: `make binaries`."""
    assert libraries.manifest()["sources"] == libraries.digest(libraries.sources().texts)


def test_manifest_has_hash_and_verdict_of_each_library():
    entries = libraries.manifest()["libraries"]
    assert set(entries) == {each.library for each in libraries.PLATFORMS.values()} | {"drive.wasm"}
    for name, entry in entries.items():
        content = libraries.packaged(name)
        assert entry["sha256"] == sha256(content).hexdigest()
        assert entry["bytes"] == len(content)
        assert "equal" in entry["equal_bits"] or "not run" in entry["equal_bits"]
        assert "-O" in entry["optimize"]


def exported_by(header: str) -> list[str]:
    text = (HEADERS / header).read_text("utf-8")
    return sorted(set(re.findall(r"#define (fmi\d\w+) +fmi\dFullName", text)))


@pytest.mark.parametrize(("header", "count"), [("fmi2Functions.h", 44), ("fmi3Functions.h", 75)])
def test_library_has_every_function_of_the_standard(header, count, tmp_path):
    """Importers look all of them up, those of model exchange and clocks too."""
    names = exported_by(header)
    assert len(names) == count
    if LINUX:
        (tmp_path / "l.so").write_bytes(libraries.packaged("x86_64-linux.so"))
        library = CDLL(str(tmp_path / "l.so"))
        assert [name for name in names if not hasattr(library, name)] == []
        assert hasattr(library, "swp_step")
    for each in libraries.PLATFORMS.values():
        content = libraries.packaged(each.library)
        assert [name for name in names if name.encode() + b"\0" not in content] == []


def test_libraries_depend_on_nothing_that_is_new_or_rare():
    for name in ("x86_64-linux.so", "aarch64-linux.so"):
        content = libraries.packaged(name)
        versions = re.findall(rb"GLIBC_2\.(\d+)", content)
        assert versions
        assert max(map(int, versions)) <= 17
        needed = set(re.findall(rb"\b(lib[\w-]+)\.so\.\d", content))
        assert needed <= {b"libc", b"libm"}
    needed = set(re.findall(rb"[\w-]+\.dll", libraries.packaged("x86_64-windows.dll")))
    own = {b"KERNEL32.dll", b"swashplate_drive.dll"}
    assert all(each in own or each.startswith(b"api-ms-win-crt-") for each in needed)


def test_universal_library_says_where_its_parts_are():
    content = libraries.packaged("darwin.dylib")
    assert int.from_bytes(content[:4], "big") == 0xCAFEBABE
    parts = []
    for i in range(int.from_bytes(content[4:8], "big")):
        entry = content[8 + 20 * i : 28 + 20 * i]
        cpu, _, offset, size, power = (
            int.from_bytes(entry[k : k + 4], "big") for k in range(0, 20, 4)
        )
        assert offset % (1 << power) == 0
        part = content[offset : offset + size]
        assert int.from_bytes(part[:4], "little") == 0xFEEDFACF  # Mach-O, 64 bits
        assert int.from_bytes(part[4:8], "little") == cpu
        assert b"fmi2DoStep" in part
        parts.append(cpu)
    assert parts == [0x01000007, 0x0100000C]  # x86-64 and ARM


@pytest.mark.slow
@pytest.mark.skipif(find_spec("ziglang") is None, reason="ziglang is not installed")
def test_clang_finds_nothing_to_warn_of(tmp_path):
    """Of the model, and of both standards' functions around it; gcc is asked by other tests."""
    libraries.written(libraries.sources().texts, tmp_path)
    flags = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror", "-c")
    for name in ("swashplate_drive.c", "fmi.c", "fmi2.c", "fmi3.c"):
        words = [sys.executable, "-m", "ziglang", "cc", *flags, "-isystem", HEADERS, name]
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


@pytest.mark.slow
@pytest.mark.skipif(find_spec("ziglang") is None, reason="ziglang is not installed")
@pytest.mark.parametrize("name", ["linux64", "aarch64-linux"])
def test_building_again_gives_equal_bytes(name):
    platform = libraries.PLATFORMS[name]
    made = libraries.compiled_library(libraries.sources(), platform)
    assert sha256(made).hexdigest() == libraries.manifest()["libraries"][platform.library]["sha256"]


@pytest.mark.slow
@pytest.mark.skipif(find_spec("ziglang") is None, reason="ziglang is not installed")
@pytest.mark.parametrize("name", ["win64", "aarch64-linux"])
def test_other_machines_give_equal_bits(name):
    from tools.build_binaries import largest_difference, runner_of

    platform = libraries.PLATFORMS[name]
    runner = runner_of(platform)
    if isinstance(runner, str):
        pytest.skip(runner)
    content = libraries.packaged(platform.library)
    for fmi in ("2.0", "3.0"):
        assert largest_difference(Drive.preset("slew"), platform, content, fmi, runner) == 0.0


@pytest.mark.slow
@pytest.mark.skipif(find_spec("ziglang") is None, reason="ziglang is not installed")
@pytest.mark.skipif(not LINUX, reason="the importer would take another folder")
def test_an_equation_of_ones_own_is_compiled(hoist, tmp_path):
    drive = hoist.with_equation(stopped_spool, sealed_spool, Seal).replace(seal_loss=0.02)
    path = export.fmu(drive, tmp_path / "own.fmu", platforms=["linux64"])
    assert validate_fmu(str(path)) == []
    assert start_of(described(path), "seal_loss") == "0.02"
    assert export.compare(path, drive, 8.0 * np.sin(np.arange(600) / 60.0)).equal


# --- refusals -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"platforms": ["linux32"]}, "platform 'linux32'.* linux64, aarch64-linux"),
        ({"fmi": "1.0"}, "'1.0'.*'2.0' or '3.0'"),
        ({"step": 0.01}, "0.01 s.* 1/512 s"),
        ({"step": float("nan")}, "step .* nan.* above 0"),
        ({"step": 1e-6}, "1020 steps"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*recursion for")
def test_refuses_options_that_there_are_not(hoist, tmp_path, options, sentence):
    with pytest.raises(InputError, match=sentence):
        export.fmu(hoist, tmp_path / "a.fmu", **options)
    assert list(tmp_path.iterdir()) == []


def test_refuses_another_ending_and_a_folder_that_is_not_there(hoist, tmp_path):
    with pytest.raises(InputError, match=r"end in \.fmu"):
        export.fmu(hoist, tmp_path / "a.zip")
    with pytest.raises(FileError, match=r"/no\b"):
        export.fmu(hoist, tmp_path / "no" / "a.fmu")


def test_a_recursion_for_another_rate_is_converted_or_refused(hoist, tmp_path):
    recursion = Drive(replace(hoist.parameters, rate=512.0))
    with pytest.warns(UserWarning, match="for another rate"):
        path = export.fmu(recursion, tmp_path / "a.fmu", step=1e-3, platforms=["linux64"])
    if LINUX:
        assert export.compare(path, recursion, np.full(400, 7.0)).equal
    wild = Drive(replace(hoist.replace(zeta=1.2, omega=350.0).parameters, rate=512.0))
    with pytest.raises((InputError, DomainError), match="lower omega"):
        export.fmu(wild, tmp_path / "b.fmu", step=1e-3)
    assert not (tmp_path / "b.fmu").exists()
