"""The fuzzer of FMUs: random calls and damaged states, under the compiler's sanitizers.

    python -m tests.export.fuzzer [--minutes 3] [--seed 1]

Both versions of the standard, a plain drive and one with every refinement: each for a quarter of
the time. Prints what was done, or the finding with the seed that brings it back at once.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import fmpy

from swashplate import Drive, export
from swashplate.export import libraries

HARNESS = Path(__file__).parent / "fuzz_fmu.c"
PREFIX = {"2.0": "-DFMI2_FUNCTION_PREFIX=", "3.0": "-DFMI3_OVERRIDE_FUNCTION_PREFIX="}
"""So that the standard's functions have their own names."""
FLAGS = ["-std=gnu11", "-O1", "-g", "-ffp-contract=off", "-Wall", "-Wextra", "-Wshadow"]
SANITIZERS = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
REFINEMENTS = {
    "Z7": 0.4,
    "Z12": 0.003,
    "spool_friction": 0.05,
    "spool_presliding": 2e-6,
    "solenoid_delay": 0.0123,
    "solenoid_lag": 0.015,
    "solenoid_hysteresis": 0.01,
    "swash_damping": 0.004,
    "cam_ripple": 0.02,
    "motor_leakage": 2e-5,
    "load_inertia": 0.3,
}


class Fuzzer(NamedTuple):
    """A compiled fuzzer of one FMU."""

    program: Path
    resources: Path
    token: str

    def run(self, seed: int, seconds: float) -> subprocess.CompletedProcess[str]:
        """Rounds from a seed on, for some seconds of the processor."""
        words = [self.program, self.resources, self.token, str(seed), str(seconds)]
        return subprocess.run(words, capture_output=True, text=True, check=False)


def fuzzer_of(
    drive: Drive, fmi: str, folder: Path, *, weakened: tuple[str, str] | None = None
) -> Fuzzer:
    """Compile the sources of a drive's FMU with the harness, in an empty folder.

    `weakened` is a text of ``fmi.c`` and what stands in its place: the fuzzer must notice.
    """
    path = export.fmu(drive, folder / "drive.fmu", fmi=fmi, platforms=["linux64"])
    fmpy.extract(str(path), unzipdir=str(folder / "fmu"))
    sources = folder / "fmu" / "sources"
    libraries.written(libraries.fmi_headers(), sources)
    shutil.copy(HARNESS, sources)
    if weakened is not None:
        text = (sources / "fmi.c").read_text("utf-8")
        assert text.count(weakened[0]) == 1
        (sources / "fmi.c").write_text(text.replace(*weakened), "utf-8")
    compiler = shutil.which("gcc") or shutil.which("clang")
    assert compiler is not None
    words = [compiler, *FLAGS, *SANITIZERS, f"-DFMI={fmi[0]}", PREFIX[fmi]]
    subprocess.run([*words, "-o", "fuzz", HARNESS.name, "-lm"], cwd=sources, check=True)
    token = fmpy.read_model_description(str(path)).guid
    return Fuzzer(sources / "fuzz", folder / "fmu" / "resources", token)


def main() -> None:
    """Fuzz, and end with status 1 at the first finding."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=3.0)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    hoist = Drive.preset("hoist")
    for drive in (hoist, hoist.replace(**REFINEMENTS).renamed("refined")):
        for fmi in PREFIX:
            with tempfile.TemporaryDirectory(prefix="fuzzed-fmu-") as folder:
                fuzzer = fuzzer_of(drive, fmi, Path(folder))
                done = fuzzer.run(arguments.seed, 60.0 * arguments.minutes / 4.0)
            print(f"{drive.name}, FMI {fmi}: {done.stdout.strip()}", flush=True)
            if done.returncode != 0:
                sys.exit(done.stderr[-6000:] or 1)


if __name__ == "__main__":
    main()
