"""Try the wheel in fresh environments: newest versions on each Python, lowest on the oldest.

For maintainers: ``make matrix``; ``make pythons``, at every change, tries the demo and the engine
on the oldest and the newest Python that the machine has. Each environment gets the wheel of this
checkout with its extras and the tools of the tests, then runs its checks in an empty folder. It
lies in build/matrix with its logs and results. Results that were obtained from this very wheel and
these very tests are kept, so that an interrupted run goes on where it stopped.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import resource
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import date
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from lowest_versions import EXTRAS, lowest_versions
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "build" / "matrix"
PAGE = ROOT / "docs" / "environments.md"
CONSTRAINTS = ROOT / "constraints.txt"
BEGIN, END = "<!-- table: begin -->", "<!-- table: end -->"

PYTHONS = ("3.11", "3.12", "3.13", "3.14")
TEST_TOOLS = (
    "hypothesis",
    "ipykernel",
    "jupytext",
    "nbclient",
    "pytest",
    "pytest-xdist",
    "sympy",
    "wasmtime",
)
SHOWN = ("numpy", "scipy", "llvmlite", "pint", "rich")
"""Libraries whose versions the table gives."""


@dataclass(frozen=True)
class Environment:
    """A Python with the newest versions of all libraries, or with the lowest that we state."""

    python: str
    versions: str

    @property
    def name(self) -> str:
        return f"{self.python}-{self.versions}"

    @property
    def folder(self) -> Path:
        return FOLDER / self.name

    @property
    def executable(self) -> Path:
        return self.folder / "venv" / "bin" / "python"


@dataclass(frozen=True)
class Check:
    """A command that must end with one of its exit codes, and without a traceback."""

    name: str
    words: tuple[str, ...]
    exit_codes: tuple[int, ...] = (0,)


CHECKS = (
    Check("demo", ("swashplate", "demo", "--out", "demo")),
    Check("export", ("swashplate", "export", "hoist", "--fmu", "hoist.fmu")),
    # 1 is a verdict, too: three seaways do not suffice for a better one
    Check("crane assess", ("swashplate", "crane", "assess", "tg3637", "--seeds", "3"), (0, 1)),
    Check("quick tests", ("pytest", "-n", "2", "-m", "not slow")),
)
DEMO, ENGINE = (
    CHECKS[0],
    Check("engine", (*CHECKS[-1].words, "tests/machine", "tests/linear")),
)
"""What `make pythons` runs: the README's first command, and what compiles equations."""
ENVIRONMENTS = (
    Environment("3.11", "lowest"),
    *(Environment(python, "newest") for python in PYTHONS),
)


# --- environments ---------------------------------------------------------------------------------


def interpreter(version: str) -> str | None:
    """Path of a Python of a version, None if there is none that runs."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    candidates = [shutil.which(f"python{version}"), *pyenv.glob(f"versions/{version}.*/bin/python")]
    for candidate in filter(None, candidates):
        probe = [str(candidate), "-c", "import sys; print('%d.%d' % sys.version_info[:2])"]
        answer = subprocess.run(probe, capture_output=True, text=True, check=False)
        if answer.stdout.strip() == version:
            return str(candidate)
    return None


def oldest_and_newest() -> tuple[Environment, ...]:
    """The oldest and the newest Python that this machine has, with the newest versions."""
    here = [version for version in PYTHONS if interpreter(version)]
    return tuple(Environment(version, "newest") for version in dict.fromkeys((here[0], here[-1])))


def pins_without_wheel(version: str) -> str:
    """What pip says of pins of constraints.txt for which a Python of a version has no wheel.

    The Python itself need not be here: the newest one asks for it. Empty if all have one.
    """
    lines = (line for line in CONSTRAINTS.read_text("utf-8").splitlines() if line[:1] != "#")
    requirements = [Requirement(line) for line in lines]
    pins = [
        f"{pin.name}{pin.specifier}"
        for pin in requirements
        if pin.marker is None or pin.marker.evaluate({"python_version": version})
    ]
    newest = oldest_and_newest()[-1]
    variables = surroundings(newest)
    del variables["PYTHONWARNINGS"]
    words = [str(interpreter(newest.python)), "-m", "pip", "install", "--quiet", "--dry-run"]
    words += ["--ignore-installed", "--no-deps", "--only-binary", ":all:"]
    with TemporaryDirectory(prefix="swashplate-") as folder:
        words += ["--python-version", version, "--target", folder, *pins]
        answer = subprocess.run(words, env=variables, capture_output=True, text=True, check=False)
    return "" if answer.returncode == 0 else answer.stderr


def surroundings(environment: Environment) -> dict[str, str]:
    """Variables of the checks: no constraints, a cache of their own, warnings are errors.

    But not with the lowest versions: they themselves warn of newer libraries that they rest on.
    """
    variables = {name: text for name, text in os.environ.items() if not name.startswith("PYTHON")}
    for name in ("PIP_CONSTRAINT", "PIP_BUILD_CONSTRAINT"):
        variables.pop(name, None)
    variables["XDG_CACHE_HOME"] = str(environment.folder / "cache")
    variables["PATH"] = f"{environment.executable.parent}{os.pathsep}{variables['PATH']}"
    variables["PYTHONWARNINGS"] = "error" if environment.versions == "newest" else "ignore"
    return variables


def install(environment: Environment, python: str, wheel: Path) -> None:
    """Make the environment anew, with the wheel, its extras and the tools of the tests."""
    shutil.rmtree(environment.folder, ignore_errors=True)
    environment.folder.mkdir(parents=True)
    subprocess.run([python, "-m", "venv", str(environment.folder / "venv")], check=True)
    variables = surroundings(environment)
    del variables["PYTHONWARNINGS"]
    pip = [str(environment.executable), "-m", "pip", "install", "-q", "--upgrade"]
    words = [*pip, f"{wheel}[{','.join(EXTRAS)}]", *TEST_TOOLS]
    if environment.versions == "lowest":
        pins = environment.folder / "lowest.txt"
        pins.write_text("\n".join(lowest_versions()) + "\n", "utf-8")
        words += ["-c", str(pins)]
    subprocess.run(words, check=True, env=variables)


def installed(environment: Environment) -> dict[str, str]:
    """Versions of Python and of the libraries of the table, and a proof that the wheel runs."""
    program = (
        "import json, platform, swashplate; from importlib.metadata import version; "
        f"print(json.dumps({{'python': platform.python_version(), 'file': swashplate.__file__, "
        f"**{{name: version(name) for name in {SHOWN}}}}}))"
    )
    answer = subprocess.run(
        [str(environment.executable), "-c", program],
        cwd=environment.folder,
        env=surroundings(environment),
        capture_output=True,
        text=True,
        check=True,
    )
    versions: dict[str, str] = json.loads(answer.stdout)
    file = Path(versions.pop("file"))
    assert file.is_relative_to(environment.folder), f"{file} is not the wheel's"
    return versions


# --- checks ---------------------------------------------------------------------------------------


def run_check(environment: Environment, check: Check) -> dict[str, Any]:
    """Run a check; whether it was green, its processor time and its last words."""
    work = environment.folder / "work"
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir()
    log = environment.folder / f"{check.name.replace(' ', '-')}.log"
    words = list(check.words)
    is_test = check.words[0] == "pytest"
    if is_test and environment.versions == "lowest":
        words += ["-W", "ignore"]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with log.open("w", encoding="utf-8") as file:
        done = subprocess.run(
            [str(environment.executable), "-m", *words],
            cwd=ROOT if is_test else work,
            env=surroundings(environment),
            stdout=file,
            stderr=subprocess.STDOUT,
            check=False,
        )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    printed = log.read_text("utf-8", errors="replace")
    crashed = not is_test and "Traceback (most recent call last)" in printed
    return {
        "green": done.returncode in check.exit_codes and not crashed,
        "cpu_seconds": round(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime),
        "words": next(reversed(printed.split("\n\n")[-1].strip().splitlines()), ""),
    }


def build_wheel(folder: Path) -> Path:
    """The wheel of this checkout, in a folder."""
    words = [sys.executable, "-m", "build", "--no-isolation", "--wheel", "--outdir", str(folder)]
    subprocess.run([*words, str(ROOT)], check=True, stdout=subprocess.DEVNULL)
    (wheel,) = folder.glob("*.whl")
    return wheel


def fingerprint(wheel: Path) -> str:
    """Hash of what is tried: the wheel and the tests."""
    digest = sha256(wheel.read_bytes())
    for path in sorted((ROOT / "tests").rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            digest.update(path.read_bytes())
    return digest.hexdigest()


def results_of(environment: Environment) -> dict[str, Any]:
    """Versions and checks of an environment; empty if it was not tried."""
    path = environment.folder / "results.json"
    if not path.exists():
        return {}
    results: dict[str, Any] = json.loads(path.read_text("utf-8"))
    return results


def try_environment(environment: Environment, wheel: Path, checks: tuple[Check, ...]) -> None:
    """Install, if need be, and run the checks that were not green yet."""
    python = interpreter(environment.python)
    if python is None:
        print(f"{environment.name}: not run, there is no Python {environment.python} here")
        return
    tried = fingerprint(wheel)
    results = results_of(environment)
    if results.get("tried") != tried:
        print(f"{environment.name}: installing ...", flush=True)
        install(environment, python, wheel)
        results = {"tried": tried, "versions": installed(environment), "checks": {}}
    for check in checks:
        if results["checks"].get(check.name, {}).get("green"):
            continue
        print(f"{environment.name}: {check.name} ...", flush=True)
        results["checks"][check.name] = run_check(environment, check)
        results["date"] = date.today().isoformat()
        results["processor"] = processor()
        (environment.folder / "results.json").write_text(json.dumps(results, indent=1), "utf-8")


def try_environments(environments: Sequence[Environment], checks: tuple[Check, ...]) -> None:
    """Build the wheel and try it in each environment."""
    with TemporaryDirectory(prefix="swashplate-") as folder:
        wheel = build_wheel(Path(folder))
        for environment in environments:
            try_environment(environment, wheel, checks)


def summary(environment: Environment) -> str:
    """One line: the Python, and what came of each check."""
    results = results_of(environment)
    words = [
        f"{name} {'green' if result['green'] else 'RED'} ({result['words']})"
        for name, result in results["checks"].items()
    ]
    return f"Python {results['versions']['python']}: {', '.join(words)}"


# --- table ----------------------------------------------------------------------------------------


def processor() -> str:
    """Kind of processor, no names of machines."""
    for line in Path("/proc/cpuinfo").read_text("utf-8").splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return "unknown"


def cells(environment: Environment) -> list[str]:
    """One row of the table."""
    results = results_of(environment)
    versions = results.get("versions", {})
    row = [versions.get("python", environment.python), environment.versions]
    row += [versions.get(name, "") for name in SHOWN]
    for check in CHECKS:
        result = results.get("checks", {}).get(check.name)
        if result is None:
            row.append("not run")
            continue
        colour = "green" if result["green"] else "**red**"
        passed = re.search(r"\d+ passed", result["words"])
        row.append(f"{colour}, {passed[0]}" if passed else colour)
    return row


def table() -> Iterator[str]:
    """Lines of the table, in Markdown."""
    tried = filter(None, map(results_of, ENVIRONMENTS))
    occasions = sorted({f"{results['processor']}, {results['date']}" for results in tried})
    yield f"Linux, {'; '.join(occasions) or 'not yet'}:"
    yield ""
    heads = ["Python", "versions", "NumPy", "SciPy", "llvmlite", "Pint", "Rich"]
    heads += [check.name for check in CHECKS]
    yield f"| {' | '.join(heads)} |"
    yield "|" + "---|" * len(heads)
    for environment in ENVIRONMENTS:
        yield f"| {' | '.join(cells(environment))} |"


def write_table() -> None:
    """Put the table between the page's markers."""
    before, _, rest = PAGE.read_text("utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    PAGE.write_text("\n".join([f"{before}{BEGIN}", *table(), f"{END}{after}"]), "utf-8")


def main() -> None:
    """Try the environments that are named, or all, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    names = {environment.name: environment for environment in ENVIRONMENTS}
    parser.add_argument("names", nargs="*", metavar="ENVIRONMENT", help=", ".join(names))
    parser.add_argument("--checks", default=None, help="some of the checks, commas between")
    parser.add_argument("--write", action="store_true", help=f"put the table into {PAGE.name}")
    parser.add_argument("--results", action="store_true", help="run nothing: show earlier results")
    parser.add_argument(
        "--extremes", action="store_true", help="demo and engine on the oldest and newest Python"
    )
    parser.add_argument("--wheels", metavar="VERSION", help="has this Python a wheel of each pin?")
    arguments = parser.parse_args()
    unknown = set(arguments.names) - set(names)
    if unknown:
        parser.error(f"There is no environment {', '.join(sorted(unknown))}: {', '.join(names)}.")
    selected = (arguments.checks or ",".join(check.name for check in CHECKS)).split(",")
    checks = tuple(check for check in CHECKS if check.name in selected)
    if not checks:
        parser.error(f"--checks names none of {', '.join(check.name for check in CHECKS)}.")
    if arguments.wheels:
        missing = pins_without_wheel(arguments.wheels)
        if missing:
            sys.exit(f"Pins without a wheel for Python {arguments.wheels}:\n{missing}")
        print(f"Every pin of {CONSTRAINTS.name} has a wheel for Python {arguments.wheels}.")
        return
    if arguments.extremes:
        chosen = oldest_and_newest()
        try_environments(chosen, (DEMO, ENGINE))
        for environment in chosen:
            print(summary(environment))
    else:
        chosen = tuple(names[name] for name in arguments.names) or ENVIRONMENTS
        if not arguments.results:
            try_environments(chosen, checks)
        print("\n".join(table()))
    if arguments.write:
        write_table()
    red = [
        f"{environment.name}: {name}"
        for environment in chosen
        for name, result in results_of(environment).get("checks", {}).items()
        if not result["green"]
    ]
    if red:
        sys.exit("Red: " + "; ".join(red))


if __name__ == "__main__":
    main()
