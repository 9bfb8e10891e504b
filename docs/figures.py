"""Make all figures of README and documentation again: `make figures`.

Each is what the commands beside its name leave behind; nothing is drawn by hand.
"""

import shlex
import shutil
import sys
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory

from typer.testing import CliRunner

from swashplate.cli import app

IMAGES = Path(__file__).parent / "images"
FIGURES = {
    "hoist-step.png": ("simulate hoist step:9 --plot hoist-step.png",),
    "envelope.png": ("limits hoist --plot envelope.png",),
    "limit-timeline.png": ("limits hoist step:9 --plot limit-timeline.png",),
    "inverse-map.png": ("compensate hoist sine:4,0.1 --plot inverse-map.png",),
    "bode.png": ("bode hoist --linear-at 4 --plot bode.png",),
    "what-if.png": (
        "whatif hoist --scale orifice=1.5 --scale pump=1.5 --maneuver sine:9,0.1 "
        "--plot what-if.png",
    ),
    "full-order.png": ("full-order hoist step:4 --plot full-order.png",),
    "crane.png": (
        "crane run tg3637 --slew 1 --until slew_deg=45 --variant volts "
        "--variant inverse --variant inverse:zv-tip --variant ideal:zv-tip "
        "--plot crane.png",
    ),
    "crane-assess.png": (
        "crane assess tg3637 --scale luff.orifice=2.5 --no-remedies --no-tipping-points "
        "--plot crane-assess.png",
    ),
    "crane-operability.png": (
        "crane operability tg3637 --control feedback=0.2/0.2+ship+clip "
        "--plot crane-operability.png",
    ),
    "crane-operability-crew.png": (
        "crane operability tg3637 --crew --drives identified --headings 90 "
        "--control feedback=0.2/0.2+ship+clip --plot crane-operability-crew.png",
    ),
    "crane-follow.png": ("crane follow tg3637 --plot crane-follow.png",),
    "encoder.png": (
        "rig hoist --out virtual",
        "campaign plot virtual/campaign.toml --run hoist_sine_4_V_0.1_Hz --channel counts "
        "--from 5.9 --to 6.6 --out encoder.png",
    ),
    "main-job.png": ("demo --out demo", "demo/result.png"),
}
"""Commands of swashplate for each figure; a last word that is a file is the figure made by them."""


def make(name: str) -> None:
    """Run a figure's commands in a folder of their own and keep the figure."""
    with TemporaryDirectory() as folder:
        made = Path(folder) / name
        for words in map(shlex.split, FIGURES[name]):
            if len(words) == 1:
                made = Path(folder) / words[0]
                continue
            with chdir(folder):
                done = CliRunner().invoke(app, words)
            if done.exit_code not in (0, 1):  # 1: a verdict that fails, and yet has its figure
                raise SystemExit(f"{' '.join(words)} ends with {done.exit_code}.\n{done.output}")
        shutil.copyfile(made, IMAGES / name)


if __name__ == "__main__":
    for each in sys.argv[1:] or FIGURES:
        print(each, flush=True)
        make(each)
