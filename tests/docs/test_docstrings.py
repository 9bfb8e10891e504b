"""The examples in the docstrings of the reference run, and print what stands there."""

import doctest
import importlib
import inspect
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

API = Path(__file__).parents[2] / "docs" / "api.toml"
OBJECTS = [
    name for page in tomllib.loads(API.read_text("utf-8"))["page"] for name in page["objects"]
]
HOW = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def examples() -> Iterator[doctest.DocTest]:
    """One test for each docstring that has examples, of the objects and of their members."""
    finder = doctest.DocTestFinder(exclude_empty=True)
    seen = set()
    for name in OBJECTS:
        module, _, attribute = name.rpartition(".")
        documented = inspect.unwrap(getattr(importlib.import_module(module), attribute))
        if not (inspect.isroutine(documented) or inspect.isclass(documented)):
            continue
        for test in finder.find(documented, name, module=False, globs={}):
            place = (test.filename, test.docstring)
            if test.examples and place not in seen:
                seen.add(place)
                yield test


@pytest.mark.slow
@pytest.mark.parametrize("example", [pytest.param(test, id=test.name) for test in examples()])
def test_examples_run(
    example: doctest.DocTest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In an empty folder; what an example needs, it makes or imports."""
    monkeypatch.chdir(tmp_path)
    printed: list[str] = []
    result = doctest.DocTestRunner(optionflags=HOW).run(example, out=printed.append)
    assert result.failed == 0, "".join(printed)
