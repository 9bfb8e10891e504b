"""Where the code's size and tangles are: a mirror for whoever works on the package next.

    python tools/mirror.py [--tree FOLDER] [--trips]

For each package: tokens, tokens a line, complexity, empty names, what its face offers, what other
packages import of it, how often it asks what kind of thing it has; then names with two meanings and
circles of imports (type imports count). With ``--trips`` three commands and a program are run and
the files and functions of the package that they pass are counted. Nobody passes or fails by these
numbers, and nobody writes code to please them. Any Python from 3.11 on will do, and for ``--trips``
that of the environment, whose libraries the commands need.
"""

from __future__ import annotations

import argparse
import ast
import io
import os
import re
import subprocess
import sys
import tokenize
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

if sys.version_info < (3, 11):  # noqa: UP036 - the Python at hand may be older than the package's
    print(
        f"Python {sys.version.split()[0]} is too old to read the package: take 3.11 or newer, "
        "for example .venv/bin/python.",
        file=sys.stderr,
    )
    sys.exit(2)

ROOT = Path(__file__).parents[1]
PACKAGE = "swashplate"
TOP = "(top)"
"""What stands for a package where modules lie beside the packages."""
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
KINDS = {
    "BlackBox",
    "Drive",
    "DriveModel",
    "EquationModel",
    "FitSetup",
    "FullOrderDrive",
    "LinearDrive",
    "Machine",
    "Model",
    "ModelSetup",
}
"""Drives, models and setups of a fit: code that asks which of them it has treats them apart."""
TRIPS = {
    "Z16 from the shell": ["simulate", "hoist", "step:9", "--set", "Z16=0.18mm"],
    "a log's column": ["fit", "{campaign}", "--out", "{out}/fit"],
    "a crane's drive": ["crane", "assess", "tg3637", "--seeds", "2"],
}
"""Commands whose way through the code is counted."""
EQUATION = """
from typing import NamedTuple

from swashplate.machine import Machine, Model, discretised, equation, simulate


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
CACHE = "SWASHPLATE_CACHE_DIR"
"""What says where compiled code is kept."""


class UnusableTreeError(Exception):
    """A tree cannot be counted: a sentence says what is wrong and what would be right."""


class Module(NamedTuple):
    """A file of the package, read once."""

    name: str  # With dots; a package's own name is that of its `__init__.py`.
    package: str  # The package below the top that it belongs to.
    path: Path
    text: str
    tree: ast.Module


class Import(NamedTuple):
    """A name of the package that a module imports."""

    local: str  # What the importer calls it.
    module: str  # Where it stands, behind all faces.
    name: str  # What it is called there; empty for the module itself.


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


def main(words: Sequence[str] | None = None) -> int:
    """Print the counts; 2 if there is nothing to count or a trip fails."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tree", type=Path, default=ROOT, help="checkout to look at")
    parser.add_argument(
        "--trips", action="store_true", help="run commands and count what they pass"
    )
    given = parser.parse_args(words)
    try:
        tree = checkout(given.tree)
        modules = modules_of(tree)
        faces = faces_of(modules)
        imports = {module: list(imports_of(module, modules, faces)) for module in modules}
        print_sizes(modules)
        print_names(modules)
        print_faces(imports, faces)
        print_kinds(imports)
        print_circles(imports)
        if given.trips:
            print_trips(tree)
    except UnusableTreeError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


# --- what is read ---------------------------------------------------------------------------------


def checkout(tree: Path) -> Path:
    """The whole path of a folder that holds the package."""
    inside = Path("src", PACKAGE)
    if not tree.exists():
        raise UnusableTreeError(f"--tree {tree} does not exist: give a folder that holds {inside}.")
    tree = tree.resolve()
    if not (tree / inside).is_dir():
        above = [folder for folder in tree.parents if (folder / inside).is_dir()]
        hint = f", here --tree {above[0]}" if above else ""
        raise UnusableTreeError(
            f"--tree {tree} holds no folder {inside}: give the folder that does{hint}."
        )
    return tree


def modules_of(tree: Path) -> list[Module]:
    """Modules of a checkout's package, in the order of their paths."""
    source = tree / "src" / PACKAGE
    modules = []
    for path in sorted(source.rglob("*.py")):
        parts = path.relative_to(source).with_suffix("").parts
        name = ".".join([PACKAGE, *parts]).removesuffix(".__init__")
        package = parts[0] if len(parts) > 1 else TOP
        text = text_of(path)
        modules.append(Module(name, package, path, text, tree_of(path, text)))
    if not modules:
        raise UnusableTreeError(
            f"{source} holds no Python file: give --tree a checkout with the package."
        )
    return modules


def text_of(path: Path) -> str:
    """Text of a Python file, which says itself how it is encoded."""
    try:
        with tokenize.open(path) as file:
            return file.read()
    except (OSError, SyntaxError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise UnusableTreeError(f"{path} cannot be read ({why}): mend or remove it.") from None


def tree_of(path: Path, text: str) -> ast.Module:
    """Syntax of a Python file."""
    try:
        return ast.parse(text, path.name)
    except (SyntaxError, ValueError) as error:
        version = sys.version.split()[0]
        raise UnusableTreeError(
            f"{path} is not Python {version} ({error}): mend it, or take the Python that it is for."
        ) from None


# --- size, complexity, names ----------------------------------------------------------------------


def print_sizes(modules: Sequence[Module]) -> None:
    """A row for each package, and their sum."""
    packages = defaultdict(list)
    for module in modules:
        packages[module.package].append(module)
    sizes = {name: size_of(packages[name]) for name in sorted(packages)}
    print(
        f"{'':16}{'files':>6}{'lines':>8}{'tokens':>9}{'/line':>7}{'compl.':>8}{'>10':>7}{'empty':>7}"
    )
    for name, size in sizes.items():
        print(line_of(name, size))
    print(line_of("all", Size(*map(sum, zip(*sizes.values(), strict=True)))))


def size_of(modules: Sequence[Module]) -> Size:
    """Counts over some modules."""
    lines = tokens = 0
    complexities: list[int] = []
    names: list[str] = []
    for module in modules:
        lines += len(module.text.splitlines())
        tokens += sum(token.type not in WHITE for token in tokenized(module.text))
        for node in ast.walk(module.tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                complexities.append(complexity(node))
            names += bound_names(node)
    return Size(
        files=len(modules),
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
    per_line = size.tokens / max(size.lines, 1)
    mean = size.complexity / max(size.functions, 1)
    complex_share = size.complex_functions / max(size.functions, 1)
    empty_share = size.empty / max(size.bound, 1)
    return (
        f"{name:16}{size.files:6}{size.lines:8}{size.tokens:9}{per_line:7.1f}{mean:8.1f}"
        f"{complex_share:7.1%}{empty_share:7.1%}"
    )


def print_names(modules: Sequence[Module]) -> None:
    """Classes and module functions whose names stand in several modules."""
    classes, functions = Counter[str](), Counter[str]()
    for module in modules:
        for node in module.tree.body:
            if isinstance(node, ast.ClassDef):
                classes[node.name] += 1
            elif isinstance(node, ast.FunctionDef):
                functions[node.name] += 1
    for what, counted in (("classes", classes), ("functions", functions)):
        twice = {name: count for name, count in counted.items() if count > 1}
        print(f"\nNames of {what} that stand in several modules: {len(twice)}")
        if twice:
            print(f"  {listed(twice)}")


def listed(counts: Mapping[str, int]) -> str:
    """Counts of names on a line."""
    return ", ".join(f"{name} {count}" for name, count in sorted(counts.items()))


# --- faces and imports ----------------------------------------------------------------------------

Faces = dict[str, dict[str, tuple[str, str]]]
"""Of each package with a face: the names there, and module and name that each stands for."""


def faces_of(modules: Sequence[Module]) -> Faces:
    """What stands in each `__init__.pyi`, packages within packages included."""
    faces: Faces = {}
    for module in modules:
        stub = module.path.with_suffix(".pyi")
        if module.path.name != "__init__.py" or not stub.is_file():
            continue
        face = faces.setdefault(module.name, {})
        for node in tree_of(stub, text_of(stub)).body:
            if isinstance(node, ast.ImportFrom):
                origin = imported_from(node, module)
                face.update({each.asname or each.name: (origin, each.name) for each in node.names})
    return faces


def imported_from(node: ast.ImportFrom, importer: Module) -> str:
    """Module that stands after `from`, with its whole name."""
    if not node.level:
        return node.module or ""
    parts = importer.name.split(".")
    is_package = importer.path.name == "__init__.py"
    above = parts[: len(parts) + is_package - node.level]
    return ".".join([*above, node.module] if node.module else above)


def imports_of(module: Module, modules: Sequence[Module], faces: Faces) -> Iterator[Import]:
    """Names of the package that a module imports, also inside functions and for types alone."""
    names = {each.name for each in modules}
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name in names:
                    yield Import(alias.asname or alias.name, alias.name, "")
        elif isinstance(node, ast.ImportFrom):
            origin = imported_from(node, module)
            for alias in node.names:
                place, name = behind_faces(origin, alias.name, names, faces)
                if place in names:  # not a library, nor a module that a face still names
                    yield Import(alias.asname or alias.name, place, name)


def behind_faces(module: str, name: str, names: set[str], faces: Faces) -> tuple[str, str]:
    """Module in which an imported name stands, and its name there; none for a module itself."""
    for _ in faces:  # a face may pass on what another offers, but none comes twice
        module, name = faces.get(module, {}).get(name, (module, name))
    whole = f"{module}.{name}"
    return (whole, "") if whole in names else (module, name)


def print_faces(imports: Mapping[Module, Sequence[Import]], faces: Faces) -> None:
    """What each package offers, and what other packages import; a module counts as a name."""
    package_of = {module.name: module.package for module in imports}
    used: dict[str, set[tuple[str, str]]] = defaultdict(set)
    for importer, imported in imports.items():
        for each in imported:
            if package_of[each.module] != importer.package:
                used[package_of[each.module]].add((each.module, each.name))
    print(
        "\nFaces: names in a package's __init__.pyi; names that other packages import, "
        "and their modules"
    )
    print(f"{'':16}{'face':>6}{'used':>6}{'from':>6}")
    for package in sorted(set(package_of.values())):
        face = faces.get(PACKAGE if package == TOP else f"{PACKAGE}.{package}", {})
        origins = {module for module, _ in used[package]}
        print(f"{package:16}{len(face):6}{len(used[package]):6}{len(origins):6}")
    inner = {
        name.removeprefix(f"{PACKAGE}."): len(face)
        for name, face in faces.items()
        if name.count(".") > 1
    }
    if inner:
        print(f"  and faces within packages: {listed(inner)}")


# --- questions of kind ----------------------------------------------------------------------------


def print_kinds(imports: Mapping[Module, Sequence[Import]]) -> None:
    """Calls of `isinstance` that ask for one of `KINDS`, by package."""
    calls, classes = kinds_by_package(imports)
    print(f"\nQuestions of kind, isinstance with {', '.join(sorted(KINDS))}: {calls.total()}")
    for package, count in sorted(calls.items()):
        print(f"  {package:14}{count:6}  {listed(classes[package])}")


def kinds_by_package(
    imports: Mapping[Module, Sequence[Import]],
) -> tuple[Counter[str], dict[str, Counter[str]]]:
    """How many calls each package has, and how often they ask for each class."""
    calls = Counter[str]()
    classes: dict[str, Counter[str]] = defaultdict(Counter)
    for module, imported in imports.items():
        own = {node.name: node.name for node in module.tree.body if isinstance(node, ast.ClassDef)}
        known = own | {each.local: each.name for each in imported}
        for node in ast.walk(module.tree):
            asked = kinds_asked(node, known)
            if asked:
                calls[module.package] += 1
                classes[module.package].update(asked)
    return calls, classes


def kinds_asked(node: ast.AST, known: Mapping[str, str]) -> set[str]:
    """Classes of `KINDS` that a node asks for, whatever the module calls them."""
    if not (
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "isinstance"
        and len(node.args) == 2
    ):
        return set()
    asked = set()
    for part in ast.walk(node.args[1]):
        if isinstance(part, ast.Name):
            asked.add(known.get(part.id, ""))
        elif isinstance(part, ast.Attribute):
            asked.add(part.attr)
    return asked & KINDS


# --- circles --------------------------------------------------------------------------------------


def print_circles(imports: Mapping[Module, Sequence[Import]]) -> None:
    """Modules, and packages, that import each other in a circle; type imports count."""
    modules: dict[str, set[str]] = {}
    packages: dict[str, set[str]] = defaultdict(set)
    for importer, imported in imports.items():
        others = {each.module for each in imported} - {importer.name}
        if importer.name != PACKAGE:  # its face imports all that is in it, by design
            modules[importer.name] = others - {PACKAGE}
            rooms = {room_of(other) for other in modules[importer.name]}
            packages[room_of(importer.name)] |= rooms - {room_of(importer.name)}
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
from pathlib import Path
passed = set()
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
except SystemExit as end:
    if end.code not in (None, 0, 1):  # 1 is the answer no: a crane does not pass, a fit is no use
        raise
sys.setprofile(None)
files = {{file for file, _ in passed}}
Path({counts!r}).write_text(f"{{len(files)}} {{len(passed)}}", "utf-8")
"""


def print_trips(tree: Path) -> None:
    """Files and functions of the package that commands pass, kernels warm, without imports."""
    if os.pathsep in str(tree):
        raise UnusableTreeError(
            f"{tree}: no Python finds a package below a name with '{os.pathsep}': "
            "rename the folder, or leave out --trips."
        )
    with TemporaryDirectory() as name:
        folder = Path(name)
        demo = ["-m", PACKAGE, "demo", "--out", str(folder / "demo")]
        run_in(folder, tree, demo, "the demo, which makes logs for the trips,")
        (folder / "valve.py").write_text(program_of(tree), "utf-8")
        programs = {what: (f"{PACKAGE}.cli", command) for what, command in TRIPS.items()}
        programs["a user's equation"] = ("valve", [])
        print("\nTrips (files, functions):")
        for number, (what, (module, command)) in enumerate(programs.items()):
            for attempt in ("cold", "warm"):  # the first time compiles
                places = {
                    "campaign": folder / "demo" / "virtual" / "campaign.toml",
                    "out": folder / f"{number}-{attempt}",
                }
                script = TRIP.format(
                    source=str(tree / "src" / PACKAGE),
                    folder=str(folder),
                    module=module,
                    command=[word.format(**places) for word in command],
                    counts=str(folder / "counts"),
                )
                run_in(folder, tree, ["-c", script], f'the trip "{what}"')
            files, functions = (folder / "counts").read_text("utf-8").split()
            print(f"  {what:24}{files:>5}{functions:>7}")


def program_of(tree: Path) -> str:
    """The program as a checkout's own mirror has it: its package may call things otherwise."""
    tool = tree / "tools" / Path(__file__).name
    statements = tree_of(tool, text_of(tool)).body if tool.is_file() else []
    for node in statements:
        if (
            isinstance(node, ast.Assign)
            and [ast.unparse(target) for target in node.targets] == ["EQUATION"]
            and isinstance(node.value, ast.Constant)
        ):
            return str(node.value.value)
    return EQUATION


def run_in(folder: Path, tree: Path, arguments: Sequence[str], what: str) -> None:
    """Run a Python process in a folder of its own that sees a checkout's package.

    Of the settings around it only the place of compiled code counts: others would change the trip.
    """
    settings = {
        "PYTHONPATH": str(tree / "src"),
        "PATH": "/usr/bin:/bin",
        "HOME": str(Path.home()),
    }
    if CACHE in os.environ:
        settings[CACHE] = os.environ[CACHE]
    done = subprocess.run(
        [sys.executable, "-P", *arguments],  # -P: a package beside the shell is not the tree's
        cwd=folder,
        env=settings,
        capture_output=True,
        encoding="utf-8",
        errors="replace",
        check=False,
    )
    if done.returncode:
        raise UnusableTreeError(failure(done, tree, what))


def failure(done: subprocess.CompletedProcess[str], tree: Path, what: str) -> str:
    """Why a process ended, and what to do."""
    lines = [line.strip(" │") for line in done.stderr.splitlines()]
    said = [line for line in lines if any(sign.isalnum() for sign in line)]
    starts = [number for number, line in enumerate(said) if re.match(r"[\w.]*Error\b", line)]
    cause = " ".join(said[starts[-1] if starts else -1 :]).rstrip(".")
    cause = cause or f"exit code {done.returncode}"
    absent = re.search(r"No module named '(\w+)", cause)
    if absent and absent[1] != PACKAGE:
        remedy = f"take the Python of the environment, for example {ROOT}/.venv/bin/python"
    else:
        remedy = "mend it there, look at another --tree, or leave out --trips"
    return f"{tree}: {what} fails with {sys.executable} ({cause}): {remedy}."


if __name__ == "__main__":
    sys.exit(main())
