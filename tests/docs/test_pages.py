"""The pages that teach are run as they stand: what they show is what happens.

A page is run from top to bottom in an empty folder; but what stands folded under the heading "Try
it without a machine", the script that makes the logs of a reader who has none, is run first:

- ``python`` blocks in one namespace; a ``text`` block right after one is what it printed; one that
  begins with ``# name.py`` is that file, too;
- ``console`` blocks line by line: ``$ swashplate ...`` is run, 80 columns wide, and the lines below
  it must be what it printed, ``...`` standing for lines left out;
- ``$ cc ...`` and ``$ ./program`` are run where there is a compiler, ``$ node ...`` where there is
  Node; ``$ head -n 4 FILE`` shows the first lines of a file;
- ``c`` and ``js`` blocks begin with ``/* name.c */`` and are that file;
- ``toml`` and ``csv`` blocks that begin with ``# name`` are that file; campaigns and fit
  fit setups are valid, other ``toml`` is a fragment;
- ``diff`` blocks change a file: ``--- name``, then lines kept, taken out and put in;
- another ``text`` block is a drawing, told by its lines and arrows.

A block of any other kind fails: nothing is skipped unseen. Lines are compared without regard to the
width of spaces and rules. Numbers of a fit differ a little between machines, so a number may be off
by 2 % or by one unit of its last digit; numbers within a name, and all other text, are equal.
"""

import io
import linecache
import re
import shlex
import subprocess
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from dataclasses import fields, is_dataclass
from hashlib import sha256
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from shutil import which

import numpy as np
import pytest
from tests.shown import check_shown, lines, same
from typer.testing import CliRunner

from swashplate.campaign import CampaignFile
from swashplate.cli import app
from swashplate.documents import validated
from swashplate.identification import FitSetup, identifying
from swashplate.parameters import ParameterSet

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PATTERNS = ("README.md", "CONTRIBUTING.md", "docs/*.md", "docs/how-to/*.md", "docs/theory/*.md")
PAGES = sorted(path for pattern in PATTERNS for path in ROOT.glob(pattern))
ELSEWHERE = {"examples.md"}
"""What tests/examples runs."""
each_page = pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))

BLOCK = re.compile(r"^```([^\n`]*)\n(.*?)^```[ \t]*$", re.MULTILINE | re.DOTALL)
TARGETS = set(re.findall(r"^([.a-z-]+):.*##", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
NOT_RUN = (r"(cd|mkdir) \S+", r"source \.venv/bin/activate", r"dask (scheduler|worker) .*")


FOLDED = re.compile(r"^## Try it without a machine\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)


def as_run(text: str) -> str:
    """A page with the scripts that make its logs at its beginning."""
    return "\n".join([*FOLDED.findall(text), FOLDED.sub("", text)])


def blocks(text: str) -> list[tuple[str, str]]:
    """Language and content of each fenced block."""
    left = BLOCK.sub("", text)
    assert "```" not in left, "a fence that opens or closes no block at the margin"
    assert not re.search(r"^    +(\$|>>>|swashplate|import|from) ", left, re.MULTILINE), (
        "an indented block of code, which would not be run: fence it"
    )
    return [(language.strip(), content) for language, content in BLOCK.findall(text)]


@contextmanager
def scheduler(words: list[str]) -> Iterator[list[str]]:
    """The words of a command with the address of a cluster that there is."""
    if "--dask" not in words or find_spec("distributed") is None:
        yield words
        return
    from distributed import LocalCluster

    with LocalCluster(n_workers=1, processes=False, dashboard_address=None) as cluster:
        at = words.index("--dask") + 1
        yield [*words[:at], cluster.scheduler_address, *words[at + 1 :]]


def expanded(words: list[str]) -> list[str]:
    """The words of a command with the files of a pattern in its place, as a shell has it."""
    return [
        name
        for word in words
        for name in (sorted(map(str, Path().glob(word))) if "*" in word else [word])
    ]


def run_swashplate(command: str, words: list[str], shown: str) -> None:
    """Run a command of swashplate and compare what it printed."""
    words, file = (words[:-2], words[-1]) if words[-2:-1] == [">"] else (words, None)
    if "--dask" in words and find_spec("distributed") is None:
        shown = "Error: A cluster needs Dask: install swashplate with its extra 'dask'."
    with scheduler(expanded(words)) as given:
        result = CliRunner().invoke(app, given)
    codes = {"Error": 2, "Not usable": 1, "Not usable, as the data are not sound": 1, "Fails": 1}
    wanted = max((codes.get(line.partition(":")[0], 0) for line in lines(shown)), default=0)
    assert result.exit_code == wanted, f"{command}\n{result.output}\n{result.exception!r}"
    if file is not None:
        Path(file).write_text(result.stdout, "utf-8")
    if shown.strip():
        check_shown(shown, result.output, command)


def run_command(command: str, shown: str) -> None:
    """Run a line of a console block, or see that it is one which only a person can run."""
    program, *words = shlex.split(command, comments=True)
    if program == "swashplate":
        run_swashplate(command, words, shown)
    elif program == "make":
        assert set(words) <= TARGETS, command
    elif program in ("cc", "node") or program.startswith("./"):
        if which("node" if program == "node" else "cc") is None:
            return
        done = subprocess.run([program, *words], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        check_shown(shown, done.stdout, command)
    elif program == "head":
        _, number, file = words
        first = Path(file).read_text("utf-8").splitlines()[: int(number)]
        check_shown(shown, "\n".join(first), command)
    else:
        known = any(re.fullmatch(each, command) for each in NOT_RUN)
        assert known, f"this cannot be run here: {command}"


def run_console(content: str) -> None:
    """Run the lines that begin with ``$``, which a backslash continues."""
    content = content.replace("\\\n", " ")
    assert content.startswith("$ "), f"a console block begins with a command: {content}"
    for part in re.split(r"^\$ ", content, flags=re.MULTILINE)[1:]:
        command, _, shown = part.partition("\n")
        run_command(command, shown)


def write_file(language: str, content: str) -> None:
    """Write a block that begins with its file's name; a fragment of TOML is only read."""
    if language == "toml":
        found = tomllib.loads(content)
        kind = CampaignFile if "axes" in found else FitSetup if "stages" in found else None
        if kind is not None and "title" in found:
            validated(found, kind, "page")
    named = re.match(r"(?:# |/\* )(\S+\.\w+)(?: \*/)?\n", content)
    assert named or language == "toml", f"which file is this?\n{content}"
    if named:
        Path(named[1]).parent.mkdir(parents=True, exist_ok=True)
        Path(named[1]).write_text(content, "utf-8")


def change_file(content: str) -> None:
    """Change a file as a diff says; what is kept and taken out stands in it once."""
    header, *rows = content.splitlines()
    path = Path(header.removeprefix("--- "))
    old = "\n".join(row[1:].strip() for row in rows if row[:1] in (" ", "-"))
    new = "\n".join(row[1:].strip() for row in rows if row[:1] in (" ", "+"))
    text = path.read_text("utf-8")
    assert text.count(old) == 1, f"{path} does not hold these lines once:\n{old}"
    path.write_text(text.replace(old, new), "utf-8")


def plain(value: object) -> object:
    """What a value was made with, without what it has computed since; arrays by their hash."""
    if is_dataclass(value):
        made_with = [each.name for each in fields(value) if each.init]
        return type(value), *(plain(getattr(value, name)) for name in made_with)
    if isinstance(value, np.ndarray):
        return value.dtype, value.shape, sha256(value.tobytes()).digest()
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return tuple(map(plain, value))
    return value


@pytest.fixture(scope="module", autouse=True)
def each_problem_is_solved_once() -> Iterator[None]:
    """Let a page's Python have the fit of its command: of equal runs, drive and setup there is one.

    What comes before the fit and after it runs in both.
    """
    solved: list[tuple[object, object]] = []
    solve = identifying._fitted

    def once(nominal: object, runs: object, *asked: object) -> object:
        if not isinstance(nominal, ParameterSet):
            return solve(nominal, runs, *asked)
        problem = nominal, plain(runs), asked
        for before, fit in solved:
            if before == problem:
                return fit
        solved.append((problem, solve(nominal, runs, *asked)))
        return solved[-1][1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(identifying, "_fitted", once)
        yield


@pytest.mark.parametrize(
    "page",
    [path for path in PAGES if path.name not in ELSEWHERE],
    ids=lambda path: str(path.relative_to(ROOT)),
)
def test_a_page_does_what_it_shows(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    names: dict[str, object] = {"__name__": page.stem}
    printed: str | None = None  # by the Python block before
    for language, content in blocks(as_run(page.read_text("utf-8"))):
        before, printed = printed, None
        match language:
            case "text" if before is not None:
                check_shown(content, before, "the Python before")
            case "text":
                assert re.search("[─│►▼]", content), f"what printed this?\n{content}"
            case "python":
                file = f"<{page.name}, block {len(linecache.cache)}>"  # equations read their source
                linecache.cache[file] = (len(content), None, content.splitlines(True), file)
                if re.match(r"# \w+\.py\n", content):
                    write_file(language, content)
                with redirect_stdout(io.StringIO()) as out:
                    exec(compile(content, file, "exec"), names)
                printed = out.getvalue()
            case "console":
                run_console(content)
            case "toml" | "csv" | "c" | "js":
                write_file(language, content)
            case "diff":
                change_file(content)
            case "{toctree}":
                for entry in re.findall(r"^[^:\n].*$", content, re.MULTILINE):
                    assert (page.parent / f"{entry}.md").exists(), entry
            case _ if language.startswith("{include} "):
                assert (page.parent / language.removeprefix("{include} ")).exists()
            case "{math}":
                assert content.strip()
            case _:
                pytest.fail(f"a block of an unknown kind, '{language}':\n{content}")


def anchors(path: Path) -> set[str]:
    """The headings of a page as they are linked."""
    titles = re.findall(r"^#+ (.*)$", BLOCK.sub("", path.read_text("utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@each_page
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", BLOCK.sub("", page.read_text("utf-8"))):
        if target.startswith(("https://", "http://")) or "generated/" in target:
            continue  # generated pages are there when the site is built, which checks them
        name, _, anchor = target.partition("#")
        path = (page.parent / name).resolve() if name else page
        assert path.exists(), target
        assert not anchor or anchor in anchors(path), target


@each_page
def test_a_script_that_makes_logs_stands_folded_at_the_end(page: Path) -> None:
    """Readers with a machine see their own commands first."""
    text = page.read_text("utf-8")
    for section in FOLDED.findall(text):
        assert section.strip().startswith("<details>\n<summary>")
        assert section.strip().endswith("</details>")
    assert (
        not FOLDED.search(text)
        or FOLDED.sub("", text).rstrip() == text[: text.index("## Try it")].rstrip()
    )


@each_page
def test_named_code_exists(page: Path) -> None:
    for dotted in set(re.findall(r"`(swashplate(?:\.\w+)+)`", page.read_text("utf-8"))):
        module, _, name = dotted.rpartition(".")
        if find_spec(dotted) is None:
            assert hasattr(import_module(module), name), dotted


@each_page
def test_mathematics_is_closed(page: Path) -> None:
    text = re.sub(r"```.*?```|`[^`]*`", "", page.read_text("utf-8"), flags=re.DOTALL)
    equations = text.split("$$")
    assert len(equations) % 2 == 1
    for equation in equations[1::2]:
        assert equation.count("{") == equation.count("}")
        begun, ended = (re.findall(rf"\\{word}\{{(\w+)\}}", equation) for word in ("begin", "end"))
        assert begun == ended
    for paragraph in "\n\n".join(equations[::2]).split("\n\n"):
        assert paragraph.count("$") % 2 == 0, paragraph


def test_lines_are_compared_as_promised() -> None:
    assert same("speed 205.25 deg/s", "speed 205.3 deg/s")
    assert same("Z13_plus -0.6 %", "Z13_plus -0.65 %")
    assert not same("speed 205.25 deg/s", "speed 211.0 deg/s")
    assert not same("hoist_step_+4_V 1", "hoist_step_+5_V 1")
    assert not same("Z10 12.3", "Z11 12.3")
    assert same("Not usable: 3 of 3 ...", "Not usable: 3 of 3 parameters")
    assert not same("Not usable: 3 of 3 ...", "Usable: 3 of 3 parameters")
    check_shown("a\n...\nd", "a\nb\nc\nd\n", "all but two")
    with pytest.raises(AssertionError, match="printed more: b"):
        check_shown("a", "a\nb\n", "one too few")
    with pytest.raises(AssertionError, match="shows   c"):
        check_shown("a\nc", "a\nb\nc\n", "one between")
