"""Compiled libraries: for which machines, made from which sources, and how.

The package carries one library for each platform, made once from the generated C and the same for
every drive: its numbers travel next to it (`swashplate.export.fmu`). A user-defined model, or a
drive with a user-defined equation, has other C, which is compiled when it is exported.
"""

from __future__ import annotations

import shutil
import struct
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from hashlib import sha256
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from swashplate.documents import parse_toml
from swashplate.drive import Drive
from swashplate.errors import FileError, InputError
from swashplate.export.c_folder import (
    LONGEST_STEP,
    Content,
    content_of,
    exported_drive,
    licence_texts,
    source_text,
)
from swashplate.export.c_source import Exported, interface
from swashplate.export.variable_list import DRIVE, References, c_header
from swashplate.machine import Machine
from swashplate.machine.code_generation import filled
from swashplate.tables import write_bytes

NAME = "swashplate_drive"
"""Stem of every library: FMI's model identifier."""
MANIFEST = "manifest.toml"
WASM = "drive.wasm"
SMALL = ("-Os", "-mllvm", "-inline-threshold=5")


class Platform(NamedTuple):
    """A machine that a library is for."""

    library: str
    """Its file in the package's folder ``binaries``."""
    ending: str
    fmi2: tuple[str, ...]
    """Folders of an FMU 2.0; of the Mac's two namings, and ARM's, importers know one or another."""
    fmi3: tuple[str, ...]
    targets: tuple[str, ...]
    """Zig's; a library for several has them side by side."""
    optimize: tuple[str, ...] = ("-O2",)
    """Two that are large, with a C library or two parts inside, are compiled for size."""


PLATFORMS: dict[str, Platform] = {
    "linux64": Platform(
        "x86_64-linux.so", ".so", ("linux64",), ("x86_64-linux",), ("x86_64-linux-gnu.2.17",)
    ),
    "aarch64-linux": Platform(
        "aarch64-linux.so",
        ".so",
        ("aarch64-linux",),
        ("aarch64-linux",),
        ("aarch64-linux-gnu.2.17",),
    ),
    "win64": Platform(
        "x86_64-windows.dll",
        ".dll",
        ("win64",),
        ("x86_64-windows",),
        ("x86_64-windows-gnu",),
        SMALL,
    ),
    "darwin64": Platform(
        "darwin.dylib",
        ".dylib",
        ("darwin64", "aarch64-darwin"),
        ("x86_64-darwin", "aarch64-darwin"),
        ("x86_64-macos.11.0", "aarch64-macos.11.0"),
        SMALL,
    ),
}
"""By the names that users give."""

FLAGS = (
    "-std=c11",
    "-g0",
    "-ffp-contract=off",
    "-fno-fast-math",
    "-fvisibility=hidden",
    "-fno-ident",
    "-fno-stack-protector",
    "-DNDEBUG",
)
WASM_FLAGS = ("-std=c11", "-Os", "-g0", "-ffp-contract=off", "-fno-ident", "-DNDEBUG")
FMI_HEADERS = (
    *(f"fmi2{name}.h" for name in ("FunctionTypes", "Functions", "TypesPlatform")),
    *(f"fmi3{name}.h" for name in ("FunctionTypes", "Functions", "PlatformTypes")),
)
FMI_SOURCES = ("fmi.h", "fmi.c", "fmi2.c", "fmi3.c")


def chosen_platforms(names: Sequence[str] | None, compiling: bool = False) -> tuple[Platform, ...]:
    """Platforms by name; by default all, or those that can be compiled for."""
    if names is None:
        this_platform = this_machine() if compiling and not has_zig() else None
        return (this_platform,) if this_platform else tuple(PLATFORMS.values())
    for name in names:
        if name not in PLATFORMS:
            raise InputError(f"There is no platform '{name}'; there are {', '.join(PLATFORMS)}.")
    if not names:
        raise InputError(f"Name at least one platform of {', '.join(PLATFORMS)}.")
    return tuple(PLATFORMS[name] for name in dict.fromkeys(names))


# --- sources --------------------------------------------------------------------------------------


def digest(texts: Mapping[str, str]) -> str:
    """SHA-256 of named texts, in the order of their names."""
    hasher = sha256()
    for name in sorted(texts):
        hasher.update(f"{name}\0{texts[name]}\0".encode())
    return hasher.hexdigest()


class Sources(NamedTuple):
    """C texts of a library by their files' names, FMI's own headers apart."""

    texts: dict[str, str]
    model: str
    """File with the model's equations."""
    layout: int
    """Hash of the model's texts, 64 bits: numbers and states of another are refused."""


def sources(content: Content | None = None) -> Sources:
    """C texts of libraries and WebAssembly; by default those of the packaged drive."""
    if content is None or content.packaged:
        return _packaged_sources()
    return _sources(content.exported, content.references)


@cache
def _packaged_sources() -> Sources:
    return _sources(exported_drive(), DRIVE)


def _sources(exported: Exported, references: References) -> Sources:
    texts = interface(exported)
    layout = int(digest(texts)[:16], 16)
    header = c_header(exported, layout, references)
    file_texts = {name: source_text(name) for name in (*FMI_SOURCES, "wasm.c")}
    return Sources({**texts, "variables.h": header, **file_texts}, f"{exported.file}.c", layout)


def one_unit(sources: Sources, fmi: str, identifier: str) -> str:
    """Text of ``fmu.c``, which an importer compiles: all of a library in one unit.

    Whatever is not of the standard's is static, and the standard's functions begin with the model's
    identifier unless the importer says otherwise, so that several can be linked into one program.
    """
    placeholders = {"n": fmi[0], "identifier": identifier, "model": sources.model}
    return filled(source_text("fmu.c"), placeholders)


# --- the package's libraries ----------------------------------------------------------------------


@cache
def manifest() -> dict[str, Any]:
    """What the package's libraries were made from, how, and their hashes."""
    path = files("swashplate.export") / "binaries" / MANIFEST
    return dict(parse_toml(path.read_text("utf-8"), str(path)))


@cache
def packaged(name: str) -> bytes:
    """A library of the package, or its WebAssembly, by its file's name."""
    path = files("swashplate.export") / "binaries" / name
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}.") from None
    if sha256(content).hexdigest() != manifest()["libraries"][name]["sha256"]:
        raise FileError(f"{path} is damaged; install swashplate again.")
    return content


# --- WebAssembly ----------------------------------------------------------------------------------

VALUES_SECTION = "swashplate.values"
"""Section of a ``.wasm`` file with the drive's numbers, little-endian doubles: what
``WebAssembly.Module.customSections`` finds, and the function ``swp_page_init`` takes."""
LICENSES_SECTION = "swashplate.licenses"
"""Section with the texts of its licences."""


def wasm(
    what: Drive | Machine,
    path: str | Path,
    *,
    step: float = LONGEST_STEP,
) -> Path:
    """Write a drive, or a machine, as WebAssembly, with a section of its numbers.

    Parameters
    ----------
    what : Drive or Machine
        What is exported. A drive with a user-defined equation, or a machine, is compiled, which
        needs the extra ``binaries``.
    path : path
        The file; an older one is replaced.
    step : float
        Step of its grid; of a drive at most 1/512. [s]

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        If the card's filter is unstable at that step, or a compiler is missing.
    FileError
        If the file cannot be written.

    Examples
    --------
    >>> from swashplate import Drive, export
    >>> export.wasm(Drive.preset("hoist"), "hoist.wasm").name
    'hoist.wasm'
    """
    content = content_of(what, step)
    numbers = content.values.astype("<f8").tobytes()
    write_bytes(licensed(webassembly(content)) + _section(VALUES_SECTION, numbers), path)
    return Path(path)


def webassembly(content: Content) -> bytes:
    """WebAssembly of what is exported, the package's if it has it; else it is compiled."""
    return packaged(WASM) if content.packaged else compiled_wasm(sources(content))


def licensed(module: bytes) -> bytes:
    """WebAssembly with the texts of its licences, which a single file can carry only inside."""
    return module + _section(LICENSES_SECTION, "\n".join(licence_texts().values()).encode())


def _section(name: str, content: bytes) -> bytes:
    """A custom section of WebAssembly."""
    section = bytes([len(name)]) + name.encode() + content
    return b"\0" + _leb128(len(section)) + section


def _leb128(number: int) -> bytes:
    """An unsigned number as WebAssembly has it: seven bits a byte, the lowest first."""
    encoded = bytearray()
    while number > 127:
        encoded.append(number & 127 | 128)
        number >>= 7
    return bytes([*encoded, number])


# --- compiling ------------------------------------------------------------------------------------


def has_zig() -> bool:
    """Whether the extra ``binaries`` is there, with which any platform can be compiled for."""
    return find_spec("ziglang") is not None


def compiled_library(sources: Sources, platform: Platform) -> bytes:
    """A library for a platform, of C texts, by Zig's compiler or this machine's ``cc``."""
    with TemporaryDirectory(prefix="swashplate-") as temporary:
        folder = Path(temporary)
        written(sources.texts, folder)
        written(fmi_headers(), folder)
        units = sorted(name for name in sources.texts if name.endswith(".c") and name != "wasm.c")
        compilers = [[*_zig(target), "-s"] for target in platform.targets]
        if not has_zig():
            if platform is not this_machine() or not shutil.which("cc"):
                raise InputError(
                    f"A library {platform.library} needs a compiler: install the extra binaries "
                    "(pip install 'swashplate[binaries]'), or choose the platform of this machine "
                    "and install a C compiler there."
                )
            compilers = [["cc"]]
        # the libraries name themselves: one name for all, and the same bytes each time
        file = f"{NAME}{platform.ending}"
        linker_options = (
            ["-Wl,-install_name,@rpath/" + file] if platform.ending == ".dylib" else ["-lm"]
        )
        objects = []
        for compiler in compilers:
            _run([*compiler, *_options(platform), "-o", file, *units, *linker_options], folder)
            objects.append((folder / file).read_bytes())
    return objects[0] if len(objects) == 1 else universal(objects)


def compiled_c(folder: Path, header: str) -> Path:
    """A shared library for this machine, of a folder that `swashplate.export.c` wrote.

    `header` is the name of the header there, ``swashplate_drive.h``.
    """
    stem = header.removesuffix(".h")
    machine = this_machine()
    ending = machine.ending if machine else ".so"
    compiler = [shutil.which("cc") or shutil.which("gcc") or ""]
    if not compiler[0]:
        if not has_zig():
            raise InputError(
                "--compile needs a C compiler: install one, or the extra binaries "
                "(pip install 'swashplate[binaries]')."
            )
        compiler = [sys.executable, "-m", "ziglang", "cc"]
    shared = ["-shared"] if ending == ".dll" else ["-shared", "-fPIC"]
    options = ["-std=c99", "-O2", "-ffp-contract=off", *shared, "-o", f"{stem}{ending}"]
    _run([*compiler, *options, f"{stem}.c", "-lm"], folder)
    return folder / f"{stem}{ending}"


def compiled_wasm(sources: Sources) -> bytes:
    """WebAssembly, made of C texts by Zig's compiler."""
    if not has_zig():
        raise InputError("WebAssembly needs a compiler: pip install 'swashplate[binaries]'.")
    with TemporaryDirectory(prefix="swashplate-") as temporary:
        folder = Path(temporary)
        written(sources.texts, folder)
        link = ["-mexec-model=reactor", "-Wl,--no-entry", "-Wl,--export-dynamic", "-s"]
        command = [*_zig("wasm32-wasi"), *WASM_FLAGS, "-fvisibility=hidden", *link]
        _run([*command, "-o", WASM, sources.model, "wasm.c"], folder)
        return (folder / WASM).read_bytes()


def _options(platform: Platform) -> list[str]:
    api = "__declspec(dllexport)"
    if platform.ending != ".dll":
        api = '__attribute__((visibility("default")))'
    # no C++ unwinds through them; on Windows the C library needs its tables
    bare = ["-fno-asynchronous-unwind-tables", "-fno-unwind-tables"]
    shared = ["-shared"] if platform.ending == ".dll" else ["-shared", "-fPIC", *bare]
    return [*FLAGS, *platform.optimize, f"-DSWP_API={api}", *shared]


def _zig(target: str) -> list[str]:
    return [sys.executable, "-m", "ziglang", "cc", "-target", target]


def _run(command: Sequence[str], folder: Path) -> None:
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    except OSError as error:
        raise InputError(f"{command[0]} cannot be run: {error.strerror or error}.") from None
    if done.returncode != 0:
        raise InputError(f"The C compiler failed: {done.stderr.strip()[-2000:]}")


def written(texts: Mapping[str, str], folder: Path) -> None:
    """Write texts as files of a folder."""
    for name, text in texts.items():
        (folder / name).write_text(text, "utf-8")


def fmi_headers() -> dict[str, str]:
    """FMI's own headers, which FMPy brings along."""
    if find_spec("fmpy") is None:
        raise InputError("FMI's headers come with FMPy: pip install 'swashplate[fmu]'.")
    folder = files("fmpy") / "c-code"
    return {name: (folder / name).read_text("utf-8") for name in FMI_HEADERS}


def this_machine() -> Platform | None:
    """The platform that runs this, None if it is none of those above."""
    import platform

    names = {
        ("linux", "x86_64"): "linux64",
        ("linux", "aarch64"): "aarch64-linux",
        ("win32", "amd64"): "win64",
        ("darwin", "x86_64"): "darwin64",
        ("darwin", "arm64"): "darwin64",
    }
    name = names.get((sys.platform, platform.machine().lower()))
    return PLATFORMS[name] if name else None


_CPU = {0x01000007: 12, 0x0100000C: 14}
"""Power of two that a part of a universal library is aligned to, by the Mac's types of CPU."""


def universal(parts: Iterable[bytes]) -> bytes:
    """A Mac's universal library of several, each for another CPU.

    A header of big-endian numbers says type, place, size and alignment of each part.
    """
    libraries = list(parts)
    at = 8 + 20 * len(libraries)
    header, body = [struct.pack(">II", 0xCAFEBABE, len(libraries))], b""
    for library in libraries:
        _, cpu, kind = struct.unpack_from("<III", library)
        power = _CPU[cpu]
        body += bytes(-(at + len(body)) % (1 << power))
        header.append(struct.pack(">IIIII", cpu, kind, at + len(body), len(library), power))
        body += library
    return b"".join(header) + body
