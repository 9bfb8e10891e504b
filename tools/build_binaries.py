"""Make the package's libraries: compile, run where they can be run, and write down what was done.

For maintainers: ``make binaries``. Needs the extra ``binaries``. A Windows library is run under
Wine, one for ARM under QEMU's user emulation, where these are found. Building again gives equal
bytes.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import zlib
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import tomlkit

from swashplate import Drive, export
from swashplate.export import fmi, libraries
from swashplate.export.variable_list import NONE

ROOT = Path(__file__).parents[1]
BINARIES = ROOT / "src" / "swashplate" / "export" / "binaries"
SAMPLES, STEP = 15360, 1.0 / 512.0
AXES = ("hoist", "slew", "luff", "neutral")
WATCHED = ("current", "shaft_speed", "shaft_position")
"""Signals that are compared; their value references stand in play.c."""
MOST_COMPRESSED = 163_000
"""Bytes that all of them together may add to the wheel: 161,269 are measured. The sample of a part
is one function, so that the card's stands for both channels but for what is a function of its own.
"""
LOADERS = ("/usr/aarch64-linux-gnu", "/usr/lib/aarch64-linux-gnu")


def main() -> None:
    """Compile everything and write the manifest."""
    sources = libraries.sources()
    BINARIES.mkdir(exist_ok=True)
    made = tomlkit.document()
    made.add(tomlkit.comment("Made by `make binaries`: what the libraries are and come from."))
    made["sources"] = libraries.digest(sources.texts)
    made["compiler"] = f"zig {version('ziglang')}"
    made["flags"] = " ".join(libraries.FLAGS)
    made["wasm_flags"] = " ".join(libraries.WASM_FLAGS)
    entries = tomlkit.table()
    contents, optimisation = {}, {libraries.WASM: libraries.WASM_FLAGS[1]}
    for each in libraries.PLATFORMS.values():
        print(f"{each.library} ...", flush=True)
        contents[each.library] = libraries.compiled_library(sources, each)
        optimisation[each.library] = " ".join(each.optimize)
    print(f"{libraries.WASM} ...", flush=True)
    contents[libraries.WASM] = libraries.compiled_wasm(sources)
    for name, content in contents.items():
        entry = tomlkit.table()
        entry["sha256"] = sha256(content).hexdigest()
        entry["bytes"] = len(content)
        entry["optimize"] = optimisation[name]
        entry["equal_bits"] = verdict(name, content)
        print(f"{name}: {len(content)} bytes; {entry['equal_bits']}")
        entries[name] = entry
    made["libraries"] = entries
    for name, content in contents.items():
        (BINARIES / name).write_bytes(content)
    (BINARIES / libraries.MANIFEST).write_text(tomlkit.dumps(made), "utf-8")
    compressed = sum(len(zlib.compress(each, 9)) for each in contents.values())
    print(f"{compressed} bytes compressed together")
    if compressed > MOST_COMPRESSED:
        sys.exit(f"That is more than {MOST_COMPRESSED}.")


# --- runs -----------------------------------------------------------------------------------------


def verdict(name: str, content: bytes) -> str:
    """Whether a library gives the numbers of `Drive.stepper`, or why it was not run."""
    if name == libraries.WASM:
        return wasm_verdict(content)
    platform = next(each for each in libraries.PLATFORMS.values() if each.library == name)
    runner = runner_of(platform)
    if isinstance(runner, str):
        return f"not run: {runner}"
    said = []
    for axis in AXES:
        for standard in ("2.0", "3.0"):
            worst = largest_difference(Drive.preset(axis), platform, content, standard, runner)
            if worst != 0.0:
                return f"{axis}, FMI {standard}: differs by {worst:g}"
        said.append(axis)
    return f"FMI 2.0 and 3.0, {', '.join(said)}, {SAMPLES} samples: equal"


def wasm_verdict(content: bytes) -> str:
    """As `verdict`, of the WebAssembly, in wasmtime."""
    import wasmtime

    store = wasmtime.Store()
    module = wasmtime.Module(store.engine, content)
    for axis in AXES:
        drive = Drive.preset(axis)
        exports = wasmtime.Instance(store, module, []).exports(store)
        memory = exports["memory"]
        exports["_initialize"](store)

        def called(function: str, *words: float, exports=exports) -> int:
            return exports[f"swp_page_{function}"](store, *words)

        values, voltage = export.values_of(drive, STEP), command()
        memory.write(store, values.astype("<f8").tobytes(), called("values", values.size))
        assert called("init", values.size) == 0
        assert called("begin", SAMPLES, STEP, len(WATCHED)) == 0
        names = export.exported_drive().names
        for place, signal in enumerate(WATCHED):
            called("select", place, names.index(signal))
        memory.write(store, voltage.astype("<f8").tobytes(), called("input", 0))
        assert called("run", 0) == 0
        found = np.empty((SAMPLES, len(WATCHED)))
        for place in range(len(WATCHED)):
            at = called("row", place)
            found[:, place] = np.frombuffer(memory.read(store, at, at + 8 * SAMPLES), "<f8")
        worst = float(np.abs(found - stepped(drive)).max())
        if worst != 0.0:
            return f"{axis}: differs by {worst:g}"
    return f"wasmtime, {', '.join(AXES)}, {SAMPLES} samples: equal"


def stepped(drive: Drive) -> np.ndarray:
    """Samples of the stepper under the command."""
    stepper = drive.stepper(1.0 / STEP)
    samples = [stepper.step(each) for each in command()]
    return np.array([[getattr(each, name) for name in WATCHED] for each in samples])


def runner_of(platform: libraries.Platform) -> list[str] | str:
    """Words before a program for a platform, or why there are none."""
    if platform.ending == ".dylib":
        return "there is no Mac here; the file was inspected only"
    if platform.library.startswith("x86_64-linux"):
        return [] if sys.platform == "linux" else "this is no Linux machine"
    if platform.ending == ".dll":
        found = shutil.which("wine64") or shutil.which("wine")
        return [found] if found else "there is no Wine here"
    found = shutil.which("qemu-aarch64") or shutil.which("qemu-aarch64-static")
    root = next((each for each in LOADERS if Path(each).is_dir()), None)
    if not found:
        return "there is no QEMU user emulation here"
    return [found, "-L", root] if root else "there is no C library for ARM here"


def largest_difference(
    drive: Drive, platform: libraries.Platform, content: bytes, standard: str, runner: list[str]
) -> float:
    """Largest difference between a library's outputs and the stepper's, inf if it fails."""
    voltage = command()
    with TemporaryDirectory(prefix="swashplate-") as place:
        folder = Path(place)
        library = folder / f"{libraries.NAME}{platform.ending}"
        library.write_bytes(content)
        (folder / "resources").mkdir()
        token = "{test}"
        values = np.minimum(export.values_of(drive, STEP), NONE)
        resource = fmi.resource(values, libraries.sources().layout, token)
        (folder / "resources" / "drive.bin").write_bytes(resource)
        (folder / "command").write_bytes(voltage.astype("<f8").tobytes())
        program = player(platform, folder)
        where = str(folder / "resources")
        if platform.ending == ".dll":
            where = f"Z:{where}"
        if standard == "2.0":
            where = "file:///" + where.replace("\\", "/").lstrip("/")
        words = [library, where, token, standard[0], repr(STEP), folder / "command"]
        environment = {"WINEDEBUG": "-all", "PATH": "/usr/bin:/bin", "HOME": str(Path.home())}
        done = subprocess.run(
            [*runner, program, *words, folder / "result"],
            capture_output=True,
            text=True,
            check=False,
            env=environment,
        )
        if done.returncode != 0:
            print(done.stderr[-2000:], file=sys.stderr)
            return float("inf")
        found = np.frombuffer((folder / "result").read_bytes(), "<f8").reshape(-1, 3)
    return float(np.abs(found - stepped(drive)).max())


def command() -> np.ndarray:
    """Voltage that visits the whole range: sines that grow, and noise."""
    time = np.arange(SAMPLES) * STEP
    noise = np.random.default_rng(1).normal(0.0, 1.0, SAMPLES)
    swings = 9.0 * np.sin(2.0 * np.pi * 0.11 * time) * np.sin(2.0 * np.pi * 0.7 * time)
    return np.clip(swings + noise, -10.0, 10.0)


def player(platform: libraries.Platform, folder: Path) -> Path:
    """The program that plays a command through a library, compiled for a platform."""
    program = folder / ("play.exe" if platform.ending == ".dll" else "play")
    libraries.written(libraries.fmi_headers(), folder)
    shutil.copy(ROOT / "tools" / "play.c", folder)
    words = [sys.executable, "-m", "ziglang", "cc", "-target", platform.targets[0], "-O1"]
    if platform.ending != ".dll":
        words += ["-ldl"]
    subprocess.run([*words, "-o", program, "play.c"], cwd=folder, check=True)
    return program


if __name__ == "__main__":
    main()
