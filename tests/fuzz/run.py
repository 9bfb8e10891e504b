"""Fuzzing of all readers for some minutes: damaged files must end in one sentence, or be read.

    python tests/fuzz/run.py [--minutes 3] [--kind hdf5] [--seed 1]

Each kind is read in processes of its own (see worker.py), in turn until the time is over. What
fails, also by a crash or by taking too long, is kept in .hypothesis/fuzz and printed.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from seeds import KINDS

HERE = Path(__file__).parent
KEPT = HERE.parents[1] / ".hypothesis" / "fuzz"
SLICE = 20.0  # seconds that a process fuzzes
PATIENCE = 80.0  # seconds that a file may take


def fuzz(kind: str, seed: int, seconds: float, folder: Path) -> str:
    """Run one process; return what it said of its failure, empty if there was none."""
    command = [sys.executable, str(HERE / "worker.py"), kind, str(seed), str(seconds), str(folder)]
    errors = folder / "errors.txt"
    with errors.open("wb") as said:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=said)
        begun = time.time()
        while process.poll() is None:
            time.sleep(0.2)
            begun = max(begun, _touched(folder))
            if time.time() - begun > PATIENCE:
                process.kill()
                process.wait()
                return f"a file takes more than {PATIENCE:g} s"
    output = process.stdout.read().decode().strip() if process.stdout else ""
    if process.returncode == 0:
        print(f"{kind:9} seed {seed:4}: {output}", flush=True)
        return ""
    return f"exit code {process.returncode}\n" + errors.read_text("utf-8", "replace")[-4000:]


def _touched(folder: Path) -> float:
    """When the file that is being read was written."""
    try:
        return max((each.stat().st_mtime for each in folder.glob("log.*")), default=0.0)
    except FileNotFoundError:  # the next one is about to be written
        return 0.0


def main() -> int:
    """Fuzz until the time is over; the exit code is 1 if anything failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=3.0)
    parser.add_argument("--kind", choices=KINDS, action="append")
    parser.add_argument("--seed", type=int, default=int(time.time()) % 100_000)
    options = parser.parse_args()
    end = time.monotonic() + 60.0 * options.minutes
    failures = 0
    seed = options.seed
    while time.monotonic() < end:
        for kind in options.kind or KINDS:
            left = end - time.monotonic()
            if left <= 0.0:
                break
            with tempfile.TemporaryDirectory() as made:
                folder = Path(made)
                said = fuzz(kind, seed, min(SLICE, left), folder)
                if said:
                    failures += 1
                    KEPT.mkdir(parents=True, exist_ok=True)
                    for path in folder.glob("log.*"):
                        kept = KEPT / f"{kind}-{seed}{path.suffix}"
                        shutil.copy(path, kept)
                        print(f"{kind} failed, the file is kept as {kept}:")
                    print(said, flush=True)
        seed += 1
    print("Nothing failed." if not failures else f"{failures} failures.")
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main())
