"""Compiled libraries of the drive: for which machines, made from which sources, and how.

The package carries one library for each platform, made once from the generated C and the same for
every drive: its numbers travel beside it (`swashplate.export.fmu`). A drive with an equation of
one's own has other C, which is compiled when it is exported.
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
from swashplate.export.c_folder import STEP, drive_sources, exported_drive, values_of
from swashplate.export.variables import c_header
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
WASM_FLAGS = ("-std=c11", *SMALL, "-g0", "-ffp-contract=off", "-fno-ident", "-DNDEBUG")
FMI_HEADERS = (
    "fmi2FunctionTypes.h",
    "fmi2Functions.h",
    "fmi2TypesPlatform.h",
    "fmi3FunctionTypes.h",
    "fmi3Functions.h",
    "fmi3PlatformTypes.h",
)
FMI_SOURCES = ("fmi.h", "fmi.c", "fmi2.c", "fmi3.c")


def chosen_platforms(names: Sequence[str] | None) -> tuple[Platform, ...]:
    """Platforms by name, all by default.

    Raises
    ------
    InputError
        For an unknown name, or none at all.
    """
    if names is None:
        return tuple(PLATFORMS.values())
    for name in names:
        if name not in PLATFORMS:
            raise InputError(f"There is no platform '{name}'; there are {', '.join(PLATFORMS)}.")
    if not names:
        raise InputError(f"Name at least one platform of {', '.join(PLATFORMS)}.")
    return tuple(PLATFORMS[name] for name in dict.fromkeys(names))


# --- sources --------------------------------------------------------------------------------------


def layout_of(drive_texts: Mapping[str, str]) -> int:
    """Hash of the drive's C texts, 64 bits: numbers and states of another are refused."""
    return int(digest(drive_texts)[:16], 16)


def digest(texts: Mapping[str, str]) -> str:
    """SHA-256 of named texts, in the order of their names."""
    made = sha256()
    for name in sorted(texts):
        made.update(f"{name}\0{texts[name]}\0".encode())
    return made.hexdigest()


def library_sources(drive: Drive | None = None) -> dict[str, str]:
    """Every C text of a library by its file's name, FMI's own headers apart.

    Parameters
    ----------
    drive : Drive, optional
        One with equations of its own; by default the packaged equations.
    """
    if drive is None:
        return dict(_packaged_sources())
    texts = drive_sources(drive)
    header = c_header(exported_drive(drive), layout_of(texts))
    own = {name: _source(name) for name in FMI_SOURCES}
    return {**texts, "fmi_variables.h": header, **own}


@cache
def _packaged_sources() -> dict[str, str]:
    return library_sources(Drive.preset("neutral"))


def all_sources(drive: Drive | None = None) -> dict[str, str]:
    """Every C text that libraries and WebAssembly are made of; as `library_sources`."""
    return {**library_sources(drive), "wasm.c": _source("wasm.c")}


@cache
def _source(name: str) -> str:
    return (files("swashplate.export") / "sources" / name).read_text("utf-8")


# --- the package's libraries ----------------------------------------------------------------------


@cache
def manifest() -> dict[str, Any]:
    """What the package's libraries were made from, how, and their hashes."""
    path = files("swashplate.export") / "binaries" / MANIFEST
    return dict(parse_toml(path.read_text("utf-8"), str(path)))


@cache
def packaged(name: str) -> bytes:
    """A library of the package, or its WebAssembly, by its file's name.

    Raises
    ------
    FileError
        If the file is damaged.
    """
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


def wasm(drive: Drive, path: str | Path, *, step: float = STEP) -> Path:
    """Write a drive as WebAssembly, its numbers in a section of their own.

    Parameters
    ----------
    drive : Drive
        Whose. One with an equation of its own is compiled, which needs the extra ``binaries``.
    path : path
        The file; an older one is replaced.
    step : float
        Step of its grid, at most 1/512. [s]

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
    """
    numbers = values_of(drive, step).astype("<f8").tobytes()
    own = bool(drive.parameters.equations)
    code = compiled_wasm(all_sources(drive)) if own else packaged(WASM)
    name = VALUES_SECTION.encode()
    content = bytes([len(name)]) + name + numbers
    made = code + b"\0" + _leb128(len(content)) + content
    write_bytes(made, path)
    return Path(path)


def _leb128(number: int) -> bytes:
    """An unsigned number as WebAssembly has it: seven bits a byte, the lowest first."""
    made = bytearray()
    while number > 127:
        made.append(number & 127 | 128)
        number >>= 7
    return bytes([*made, number])


# --- compiling ------------------------------------------------------------------------------------


def has_zig() -> bool:
    """Whether the extra ``binaries`` is there, with which any platform can be compiled for."""
    return find_spec("ziglang") is not None


def compiled(texts: Mapping[str, str], platform: Platform) -> bytes:
    """A library for a platform, made of C texts by Zig's compiler, or for this machine by ``cc``.

    Raises
    ------
    InputError
        If a compiler or FMI's headers are missing, or it fails.
    """
    with TemporaryDirectory(prefix="swashplate-") as place:
        folder = Path(place)
        written(texts, folder)
        written(fmi_headers(), folder)
        units = sorted(name for name in texts if name.endswith(".c") and name != "wasm.c")
        if not has_zig():
            if platform is not _this_machine() or not shutil.which("cc"):
                raise InputError(
                    f"A library {platform.library} needs a compiler: install the extra binaries "
                    "(pip install 'swashplate[binaries]'), or choose the platform of this machine "
                    "and have a C compiler there."
                )
            out = f"{NAME}{platform.ending}"
            _run(["cc", *_options(platform), "-o", out, *units, "-lm"], folder)
            return (folder / out).read_bytes()
        parts = [_by_zig(platform, target, units, folder) for target in platform.targets]
    return parts[0] if len(parts) == 1 else universal(parts)


def compiled_c(folder: Path, header: str) -> Path:
    """A shared library of a folder of C source, made for this machine.

    Parameters
    ----------
    folder : path
        With what `swashplate.export.c` wrote.
    header : str
        Name of the header there, ``swashplate_drive.h``.

    Raises
    ------
    InputError
        If there is no compiler, or it fails.
    """
    stem = header.removesuffix(".h")
    machine = _this_machine()
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
    words = ["-std=c99", "-O2", "-ffp-contract=off", *shared, "-o", f"{stem}{ending}"]
    _run([*compiler, *words, f"{stem}.c", "-lm"], folder)
    return folder / f"{stem}{ending}"


def compiled_wasm(texts: Mapping[str, str]) -> bytes:
    """WebAssembly of the drive, made of C texts by Zig's compiler."""
    if not has_zig():
        raise InputError("WebAssembly needs a compiler: pip install 'swashplate[binaries]'.")
    with TemporaryDirectory(prefix="swashplate-") as place:
        folder = Path(place)
        written(texts, folder)
        link = ["-mexec-model=reactor", "-Wl,--no-entry", "-Wl,--export-dynamic", "-s"]
        command = [*_zig("wasm32-wasi"), *WASM_FLAGS, "-fvisibility=hidden", *link]
        _run([*command, "-o", WASM, "swashplate_drive.c", "wasm.c"], folder)
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


def _by_zig(platform: Platform, target: str, units: Sequence[str], folder: Path) -> bytes:
    # the libraries name themselves: one name for all, and the same bytes each time
    out = f"{NAME}{platform.ending}"
    more = ["-Wl,-install_name,@rpath/" + out] if platform.ending == ".dylib" else ["-lm"]
    _run([*_zig(target), *_options(platform), "-s", "-o", out, *units, *more], folder)
    return (folder / out).read_bytes()


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


def _this_machine() -> Platform | None:
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
    for each in libraries:
        _, cpu, kind = struct.unpack_from("<III", each)
        power = _CPU[cpu]
        body += bytes(-(at + len(body)) % (1 << power))
        header.append(struct.pack(">IIIII", cpu, kind, at + len(body), len(each), power))
        body += each
    return b"".join(header) + body
