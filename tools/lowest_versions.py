"""Print the lowest version of each dependency that pyproject.toml states, as pip's constraints.

``python tools/lowest_versions.py > lowest.txt``, then ``pip install -c lowest.txt .``
"""

import re
import tomllib
from pathlib import Path

PROJECT = Path(__file__).parents[1] / "pyproject.toml"
EXTRAS = ("binaries", "dask", "fmu", "mdf", "mpc", "tdms")
"""All but the development tools, which nobody has to share an environment with."""


def lowest_versions() -> list[str]:
    """The lowest version of every direct dependency, extras included: ``["numpy==2.0", ...]``."""
    project = tomllib.loads(PROJECT.read_text("utf-8"))["project"]
    stated = list(project["dependencies"])
    for extra in EXTRAS:
        stated += project["optional-dependencies"][extra]
    pins = set()
    for line in stated:
        bound = re.fullmatch(r"([\w-]+)>=([\d.]+)", line)
        if bound is None:
            raise SystemExit(f"{PROJECT.name}: '{line}' must be a lower bound alone: numpy>=2.0")
        pins.add(f"{bound[1]}=={bound[2]}")
    return sorted(pins)


if __name__ == "__main__":
    print("\n".join(lowest_versions()))
