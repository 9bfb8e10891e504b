"""Where the code's size and tangles are: a mirror for whoever works on the package next.

    python tools/mirror.py [--tree FOLDER] [--trips]

For each package: tokens, tokens a line, complexity, empty names, then names with two meanings and
circles of imports (type imports count). With ``--trips`` three commands and a program are run and
the files and functions of the package that they pass are counted. Nobody passes or fails by these
numbers, and nobody writes code to please them. Run it with the Python of the environment: circles
need its graph of imports.
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import subprocess
import sys
import tokenize
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
PACKAGE = "swashplate"
COMPLEX = 10
"""Complexity (McCabe) above which a function takes several readings."""
WHITE = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}
PRIVATE_DIALECT = """
each found made own said known wanted asked kept told begun given chosen held place places whole one
ours met seen left more
"""
CONVENTIONAL = """
x y a b i j k n m val value out data tmp res result ret item items obj thing stuff args kwargs
"""
EMPTY = {*PRIVATE_DIALECT.split(), *CONVENTIONAL.split()}
"""Names that say nothing about what they stand for: this project's habits, and everybody's."""
BRANCHES = (
    ast.If,
    ast.IfExp,
    ast.For,
    ast.While,
    ast.ExceptHandler,
    ast.comprehension,
    ast.match_case,
    ast.Assert,
)
TRIPS = {
    "Z16 from the shell": ["simulate", "hoist", "step:9", "--set", "Z16=0.18mm"],
    "a log's column": ["fit", "{campaign}", "--out", "{out}/fit"],
    "a crane's drive": ["crane", "assess", "tg3637", "--seeds", "2"],
}
"""Commands whose way through the code is counted."""
EQUATION = """
from typing import NamedTuple

from swashplate.equations import Machine, Model, discretised, equation, simulate


class Numbers(NamedTuple):
    lag: float = 0.05


class State(NamedTuple):
    spool: float = 0.0


@equation
def rates(state: State, u: float, p: Numbers) -> State:
    return State((u - state.spool) / p.lag)


def main() -> None:
    valve = Model("valve", Numbers, State, discretised(rates, "midpoint"))
    simulate(Machine(valve, Numbers()), {"u": [0.0] * 10 + [1.0] * 90}, 1000.0)
"""
"""A program that simulates an equation of a user, counted likewise."""


class Size(NamedTuple):
    """Counts of one package."""

    files: int
    lines: int
    tokens: int
    functions: int
    complexity: int  # The sum over all functions.
    complex_functions: int
    bound: int  # Names that are bound.
    empty: int  # Of these, names that say nothing.


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tree", type=Path, default=ROOT, help="checkout to look at")
    parser.add_argument(
        "--trips", action="store_true", help="run commands and count what they pass"
    )
    chosen = parser.parse_args()
    source = chosen.tree / "src" / PACKAGE
    packages = by_package(source)
    print(
        f"{'':16}{'files':>6}{'lines':>8}{'tokens':>9}{'/line':>7}{'compl.':>8}{'>10':>7}{'empty':>7}"
    )
    sizes = {name: size_of(files) for name, files in packages.items()}
    for name, size in sizes.items():
        print(line_of(name, size))
    print(line_of("all", Size(*map(sum, zip(*sizes.values(), strict=True)))))
    print_names(packages)
    print_circles(chosen.tree)
    if chosen.trips:
        print_trips(chosen.tree)


def by_package(source: Path) -> dict[str, list[Path]]:
    """Files of each package; modules at the top together."""
    packages = defaultdict(list)
    for path in sorted(source.rglob("*.py")):
        parts = path.relative_to(source).parts
        packages[parts[0] if len(parts) > 1 else "(top)"].append(path)
    return dict(sorted(packages.items()))


# --- size, complexity, names ----------------------------------------------------------------------


def size_of(files: Sequence[Path]) -> Size:
    """Counts over some files."""
    lines = tokens = 0
    complexities, names = [], []
    for path in files:
        text = path.read_text("utf-8")
        lines += len(text.splitlines())
        tokens += sum(token.type not in WHITE for token in tokenized(text))
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                complexities.append(complexity(node))
            names += bound_names(node)
    return Size(
        files=len(files),
        lines=lines,
        tokens=tokens,
        functions=len(complexities),
        complexity=sum(complexities),
        complex_functions=sum(each > COMPLEX for each in complexities),
        bound=len(names),
        empty=sum(name in EMPTY for name in names),
    )


def tokenized(text: str) -> Iterator[tokenize.TokenInfo]:
    """Tokens of a file."""
    return tokenize.generate_tokens(io.StringIO(text).readline)


def complexity(function: ast.AST) -> int:
    """McCabe's complexity: 1 and the branches, those of inner functions included."""
    count = 1
    for node in ast.walk(function):
        if isinstance(node, BRANCHES):
            count += 1
        elif isinstance(node, ast.BoolOp):
            count += len(node.values) - 1
    return count


def bound_names(node: ast.AST) -> Iterator[str]:
    """Names that a node binds: assigned variables and arguments."""
    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
        yield node.id
    elif isinstance(node, ast.arg):
        yield node.arg


def line_of(name: str, size: Size) -> str:
    """A row of the table."""
    per_line = size.tokens / size.lines
    mean = size.complexity / max(size.functions, 1)
    complex_share = size.complex_functions / max(size.functions, 1)
    empty_share = size.empty / max(size.bound, 1)
    return (
        f"{name:16}{size.files:6}{size.lines:8}{size.tokens:9}{per_line:7.1f}{mean:8.1f}"
        f"{complex_share:7.1%}{empty_share:7.1%}"
    )


def print_names(packages: dict[str, list[Path]]) -> None:
    """Classes and module functions whose names stand in several modules."""
    classes, functions = Counter[str](), Counter[str]()
    for path in (path for files in packages.values() for path in files):
        for node in ast.parse(path.read_text("utf-8")).body:
            if isinstance(node, ast.ClassDef):
                classes[node.name] += 1
            elif isinstance(node, ast.FunctionDef):
                functions[node.name] += 1
    for what, counted in (("classes", classes), ("functions", functions)):
        twice = {name: count for name, count in counted.items() if count > 1}
        listed = ", ".join(f"{name} {count}" for name, count in sorted(twice.items()))
        print(f"\nNames of {what} that stand in several modules: {len(twice)}\n  {listed}")


# --- circles --------------------------------------------------------------------------------------

CIRCLES = """
import grimp, json
graph = grimp.build_graph({package!r}, exclude_type_checking_imports=False, cache_dir=None)
print(json.dumps({{m: sorted(graph.find_modules_directly_imported_by(m)) for m in graph.modules}}))
"""


def print_circles(tree: Path) -> None:
    """Modules, and packages, that import each other in a circle; type imports count."""
    text = in_tree(tree, ["-c", CIRCLES.format(package=PACKAGE)])
    modules = {name: set(imported) for name, imported in json.loads(text).items()}
    # a package's face imports all that is in it, by design
    modules = {name: others for name, others in modules.items() if "." in name}
    packages: dict[str, set[str]] = defaultdict(set)
    for name, imported in modules.items():
        for other in imported:
            if room_of(name) != room_of(other):
                packages[room_of(name)].add(room_of(other))
    for what, graph in (("modules", modules), ("packages", dict(packages))):
        print(f"\nCircles of {what}: {len(circles(graph))}")
        for circle in circles(graph):
            print(f"  {', '.join(sorted(circle))}")


def room_of(module: str) -> str:
    """The package below the top that a module belongs to."""
    return ".".join(module.split(".")[:2])


def circles(graph: dict[str, set[str]]) -> list[set[str]]:
    """Strongly connected groups of several nodes (Tarjan)."""
    order: dict[str, int] = {}
    lowest: dict[str, int] = {}
    stack: list[str] = []
    groups: list[set[str]] = []

    def visit(node: str) -> None:
        order[node] = lowest[node] = len(order)
        stack.append(node)
        for other in sorted(graph.get(node, ())):
            if other not in order:
                visit(other)
                lowest[node] = min(lowest[node], lowest[other])
            elif other in stack:
                lowest[node] = min(lowest[node], order[other])
        if lowest[node] == order[node]:
            group = set()
            while node not in group:
                group.add(stack.pop())
            if len(group) > 1:
                groups.append(group)

    sys.setrecursionlimit(10_000)
    for node in sorted(graph):
        if node not in order:
            visit(node)
    return groups


# --- trips ----------------------------------------------------------------------------------------

TRIP = """
import sys
passed, deepest = set(), 0
def note(frame, event, argument):
    code = frame.f_code
    if event == "call" and {source!r} in code.co_filename and "<" not in code.co_name:
        passed.add((code.co_filename, code.co_qualname))
sys.path.insert(0, {folder!r})
from {module} import main
sys.argv = ["swashplate", *{command!r}]
sys.setprofile(note)
try:
    main()
except SystemExit:
    pass
sys.setprofile(None)
print(len({{file for file, _ in passed}}), len(passed), file=sys.stderr)
"""


def print_trips(tree: Path) -> None:
    """Files and functions of the package that commands pass, kernels warm, without imports."""
    source = str(tree / "src" / PACKAGE)
    with TemporaryDirectory() as folder:
        in_tree(tree, ["-m", PACKAGE, "demo", "--out", f"{folder}/demo"])
        places = {"campaign": f"{folder}/demo/virtual/campaign.toml", "out": folder}
        (Path(folder) / "valve.py").write_text(EQUATION, "utf-8")
        programs = {what: ("swashplate.cli", command) for what, command in TRIPS.items()}
        programs["a user's equation"] = ("valve", [])
        print("\nTrips (files, functions):")
        for what, (module, command) in programs.items():
            arguments = [word.format(**places) for word in command]
            script = TRIP.format(
                source=source,
                folder=folder,
                module=module,
                command=arguments,
            )
            for _ in range(2):  # the first time compiles
                for old in (Path(folder) / "fit").glob("*"):
                    old.unlink()
                counted = in_tree(tree, ["-c", script], errors=True)
            files, functions = counted.split()[-2:]
            print(f"  {what:24}{files:>5}{functions:>7}")


def in_tree(tree: Path, arguments: Sequence[str], *, errors: bool = False) -> str:
    """What a Python process says that sees a checkout's package."""
    done = subprocess.run(
        [sys.executable, *arguments],
        env={"PYTHONPATH": str(tree / "src"), "PATH": "/usr/bin:/bin", "HOME": str(Path.home())},
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stderr if errors else done.stdout


if __name__ == "__main__":
    main()
