"""An hour of four channels at 512 Hz: read, its windows checked and processed, as a whole process.

    .venv/bin/python benchmarks/campaign_hour.py

Prints medians over five processes, and their largest memory.
"""

import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

import numpy as np
import polars as pl
from campaign_file import campaign_text

from swashplate import Drive

CHANNELS = {
    "current": '{ kind = "rectified_current", column = "current" }',
    "counts": '{ kind = "encoder_counts", column = "counts", counts_per_turn = 2526.3 }',
    "swash": '{ kind = "swash_angle", column = "swash" }',
}
PROCESS = """
import resource, sys, time
begun = time.perf_counter()
from swashplate import Campaign
from swashplate.campaign import examine
from swashplate.campaign import speed_of
campaign = Campaign.from_toml(sys.argv[1])
read = time.perf_counter()
for run in campaign:
    examine(run)
checked = time.perf_counter()
for run in campaign:
    speed_of(run["counts"])
done = time.perf_counter()
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(read - begun, checked - read, done - checked, done - begun, peak)
"""


def write_hour(folder: Path) -> Path:
    """A log of the hoist under a slow, wandering command."""
    time = np.arange(512 * 3600 + 1) / 512.0
    voltage = 5.0 * np.sin(2 * np.pi * 0.05 * time) * np.sin(2 * np.pi * 0.003 * time)
    run = Drive.preset("hoist").simulate(voltage)
    noise = np.random.default_rng(0).normal(size=(2, time.size))
    current = run.current_positive + run.current_negative
    pl.DataFrame(
        {
            "time [s]": np.round(time, 6),
            "voltage [V]": np.round(voltage, 4),
            "current [A]": np.round(current + 0.002 * noise[0], 4),
            "counts": np.floor(run.shaft_position * 2526.3 / (2 * np.pi)).astype(int),
            "swash [rad]": np.round(run.swash_angle + 1e-4 * noise[1], 5),
        }
    ).write_csv(folder / "hour.csv")
    text = campaign_text(
        "One hour",
        axis="hoist",
        drive="hoist",
        command="voltage",
        interpolation="linear",
        channels=CHANNELS,
        runs={"hour.csv": "fit"},
    )
    (folder / "campaign.toml").write_text(text, "utf-8")
    return folder / "campaign.toml"


def main() -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as folder:
        path = write_hour(Path(folder))
        rows = []
        for _ in range(5):
            done = subprocess.run(
                [sys.executable, "-c", PROCESS, str(path)],
                capture_output=True,
                text=True,
                check=True,
            )
            rows.append([float(word) for word in done.stdout.split()])
        size = (Path(folder) / "hour.csv").stat().st_size / 1e6
    names = ("imports and reading", "check", "speed from counts", "all")
    columns = list(zip(*rows, strict=True))
    print(f"1 h at 512 Hz, 4 channels, CSV of {size:.0f} MB, medians of {len(rows)} processes")
    for name, column in zip(names, columns[:-1], strict=True):
        print(f"{name:22s}{median(column):6.2f} s")
    print(f"{'largest memory':22s}{max(columns[-1]):6.0f} MB")


if __name__ == "__main__":
    main()
