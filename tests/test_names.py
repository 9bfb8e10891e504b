"""No module is called as what it defines, and no package mistakes one for the other.

A package attribute is set by whoever comes last, the import of a module of that name or the lazy
package that looks up the function.
"""

import ast
import importlib
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import swashplate

ROOT = Path(swashplate.__file__).parent
FILES = sorted(ROOT.rglob("*.py"))
STUBS = sorted(ROOT.rglob("__init__.pyi"))
DEFINITIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts).removesuffix(".__init__")


def lines_of(stub: Path) -> list[tuple[str, str]]:
    """Module and name of all that a stub exports; the module is empty for a module itself."""
    return [
        (node.module or "", alias.name)
        for node in ast.parse(stub.read_text("utf-8")).body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    ]


@pytest.mark.slow
def test_no_module_defines_what_it_is_called() -> None:
    same = [
        module_name(path)
        for path in FILES
        for node in ast.parse(path.read_text("utf-8")).body
        if isinstance(node, DEFINITIONS) and node.name == path.stem
    ]
    assert len(FILES) > 100
    assert same == []


@pytest.mark.slow
def test_no_class_name_stands_for_two_things() -> None:
    modules: dict[str, list[str]] = {}
    for path in FILES:
        for node in ast.parse(path.read_text("utf-8")).body:
            if isinstance(node, ast.ClassDef):
                modules.setdefault(node.name, []).append(module_name(path))
    assert len(modules) > 300
    assert {name: defined for name, defined in modules.items() if len(defined) > 1} == {}


def test_no_package_exports_a_function_called_as_one_of_its_modules() -> None:
    assert len(STUBS) > 8
    for stub in STUBS:
        modules = {path.stem for path in stub.parent.glob("*.py")}
        modules |= {path.parent.name for path in stub.parent.glob("*/__init__.py")}
        functions = {name for module, name in lines_of(stub) if module}
        assert functions & modules - {"__version__"} == set(), module_name(stub)


@pytest.mark.parametrize("stub", STUBS, ids=module_name)
def test_a_lazy_package_gives_what_its_stub_names(stub: Path) -> None:
    package = importlib.import_module(module_name(stub))
    exported = lines_of(stub)
    assert {name for _, name in exported} <= set(package.__all__)
    for module, name in exported:
        given = getattr(package, name)
        if not module:
            assert isinstance(given, ModuleType), name
            continue
        assert not isinstance(given, ModuleType), name
        assert given is getattr(importlib.import_module(f"{package.__name__}.{module}"), name)


@pytest.mark.slow
@pytest.mark.parametrize("first", ["modules", "names"])
def test_the_order_of_imports_does_not_matter(first: str) -> None:
    """In a process of its own: modules before names, names before modules."""
    modules = [name for name in map(module_name, FILES) if not name.endswith("__main__")]
    names = [
        (module_name(stub), name, not module) for stub in STUBS for module, name in lines_of(stub)
    ]
    program = f"""
import importlib
from types import ModuleType

def import_modules():
    for module in {modules}:
        importlib.import_module(module)

def check_names():
    for package, name, is_module in {names}:
        given = getattr(importlib.import_module(package), name)
        assert isinstance(given, ModuleType) is is_module, (package, name, given)

if {first == "modules"}:
    import_modules()
check_names()
import_modules()
check_names()
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
