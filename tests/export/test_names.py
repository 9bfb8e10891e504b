"""Names of user-defined models that C, C++ or the interface keeps for itself."""

import importlib.util
import shutil
import subprocess
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from tests.export.conftest import InC
from tests.marks import rest_slow

from swashplate.export import c, content_of
from swashplate.export.c_source import interface
from swashplate.machine import Machine, Model, Tap, join, simulate

NAMES = """
m status measured i step inputs now before whole fraction line before_record newest stale settled
ready started k next window good value values range ranges index count output output_names
new delete this template operator namespace private virtual typename bool_ bool double double_ short
register union sizeof typedef unix NULL NAN INFINITY DBL_MAX HUGE_VAL fabs sin sinf strlen memset
memcpy put_inputs take_sample one_sample is_finite all_finite READY VALUES OK H LINE API OUTPUTS
nasty nasty_model nasty_step nasty_update nasty_sample nasty_window nasty_inputs nasty_line sample
NASTY_OK NASTY_m NASTY_LINE PARAMETER_m PARAMETERS INPUT_m LIMIT_m OPTION_m größe h state p
given options signals limits
""".split()  # noqa: SIM905
"""Words of C and of C++, and names of the interface of a model called ``nasty``."""
MODELS = """
step class new now before inputs line measured memory value window main math stdio limits double
nasty_ m A OK model
""".split()  # noqa: SIM905
STEP, SAMPLES = 0.01, 30
FEW = 31
"""Names in one model: limits are the bits of one number."""

TEXT = """
from typing import NamedTuple

from swashplate.machine import equation


class Numbers(NamedTuple):
{parameters}


class State(NamedTuple):
{states}


class Signals(NamedTuple):
{signals}


class Options(NamedTuple):
{options}


class Limits(NamedTuple):
{limits}


@equation
def sample(state: State, {inputs}, p: Numbers, options: Options) -> Signals:
    total = abs(state.{state} > 0.0) + {sum}
{locals}
    return Signals({results})


@equation
def limits(state: State, signals: Signals) -> Limits:
    return Limits({limited})


@equation
def advance(state: State, signals: Signals, p: Numbers, h: float) -> State:
    return State({following})
"""


def module_of(kind: str, names: list[str], folder: Path) -> ModuleType:
    """Module of a model that has many names of one kind."""
    own = {
        "input": ["drive"], "parameter": ["gain"], "state": ["filled"], "signal": ["seen"],
        "option": ["rough"], "limit": ["full"], "local": ["sum_"],
    }  # fmt: skip
    own[kind] = names

    def fields(of: str, declared: str) -> str:
        return "\n".join(f"    {name}: {declared}" for name in own[of])

    (first, *_) = own["state"]
    terms = [*own["input"], *(f"p.{name}" for name in own["parameter"])]
    body = []
    for name in own["local"]:
        body.append(f"    {name} = 0.5 * total + state.{first} * p.{own['parameter'][0]}")
        body.append(f"    total = {name} * {name} / (1.0 + {name} * {name})")
    for name in own["option"]:
        body += [f"    if options.{name} is not None:", "        total = 0.5 * total + 0.1"]
    seen = own["signal"][0]
    text = TEXT.format(
        parameters=fields("parameter", "float"),
        states=fields("state", "float"),
        signals=fields("signal", "float"),
        options=fields("option", "bool | None = None"),
        limits=fields("limit", "bool"),
        inputs=", ".join(f"{name}: float" for name in own["input"]),
        state=first,
        sum=" + ".join(terms),
        locals="\n".join(body),
        results=", ".join(f"{n + 1}.0 * total" for n in range(len(own["signal"]))),
        limited=", ".join(f"signals.{seen} > {n}.0" for n in range(len(own["limit"]))),
        following=", ".join(f"state.{name} + h * signals.{seen}" for name in own["state"]),
    )
    path = folder / f"of_{kind}.py"
    path.write_text(text, "utf-8")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def model_of(module: ModuleType, name: str, **further: Any) -> Model:
    return Model(
        name, module.Numbers, module.State, module.advance, sample=module.sample,
        options=module.Options, limits=module.limits, **further,
    )  # fmt: skip


def numbers_of(module: ModuleType) -> Any:
    return module.Numbers(*(0.1 + 0.01 * n for n, _ in enumerate(module.Numbers._fields)))


USED = ("h", "state", "p", "given", "options", "signals", "limits")
MACROS = ("NASTY_LINE",)
LEFT_OUT = {
    "input": ("inputs", *USED),
    "local": USED,
    "option": (*MACROS, "bool"),
    **dict.fromkeys(("parameter", "state", "signal", "limit"), MACROS),
}
"""What Python takes otherwise, and fields that are called as the model's own macro."""


def read_as_cpp(header: str, folder: Path) -> None:
    """Compile a header as C++, if there is a compiler."""
    compiler = shutil.which("g++")
    if compiler is None:
        return
    (folder / "read.cpp").write_text(header, "utf-8")
    strict = "-std=c++20 -Wall -Wextra -pedantic -Werror -fsyntax-only -x c++".split()  # noqa: SIM905
    done = subprocess.run(
        [compiler, *strict, "read.cpp"], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def check(model: Model, inputs: dict[str, Any], parameters: Any, compiled: Any, to: Path) -> None:
    """C99 without a warning, C++ too, and the bits of the march."""
    run = simulate(Machine(model, parameters), inputs, 1.0 / STEP)
    content = content_of(Machine(model, parameters), STEP, prefix="nasty")
    texts = interface(content.exported)
    read_as_cpp(texts[f"{content.exported.file}.h"], to)
    in_c = InC(compiled(texts, ["-O0"]), "nasty", content.values)
    outputs = {name: in_c.number("_output", name) for name in content.exported.names}
    for n in range(SAMPLES):
        assert in_c.step(*(float(inputs[name][n]) for name in content.exported.signals)) == 0
        for name, number in outputs.items():
            assert in_c.output(number) == run[name][n], name


@pytest.mark.parametrize(
    "kind", rest_slow(["input", "parameter", "state", "signal", "option", "limit", "local"])
)
def test_names_of_numbers(kind: str, compiled: Any, tmp_path: Path) -> None:
    names = [name for name in NAMES if name not in LEFT_OUT.get(kind, ())]
    for first in range(0, len(names), FEW):
        check_kind(kind, names[first : first + FEW], compiled, tmp_path)


def check_kind(kind: str, names: list[str], compiled: Any, tmp_path: Path) -> None:
    module = module_of(kind, names, tmp_path)
    every = names if kind == "input" else ["drive"]
    inputs = {name: np.sin(np.arange(SAMPLES) / (3.0 + n)) for n, name in enumerate(every)}
    taps = {name: Tap(name, delay=module.Numbers._fields[0]) for name in every[::2]}
    model = model_of(module, "nasty", taps=taps, integrals={"grown": module.State._fields[0]})
    check(model, inputs, numbers_of(module), compiled, tmp_path)


def test_names_of_parts_and_integrals(compiled: Any, tmp_path: Path) -> None:
    module = module_of("local", ["sum_"], tmp_path)
    names = [name for name in NAMES[:40] if name.isascii()]
    parts = [model_of(module, name) for name in [*names, "m_options", "drive_rate"]]
    integrals = dict.fromkeys(("started", "card", "card_rate", "new"), "filled")
    model = join("nasty", *parts, integrals=integrals)
    values = model.parameters(*(numbers_of(module) for _ in parts))
    check(model, {"drive": np.sin(np.arange(SAMPLES) / 3.0)}, values, compiled, tmp_path)


@pytest.mark.parametrize("name", rest_slow(MODELS, 3))
def test_names_of_models(name: str, compiled: Any, tmp_path: Path) -> None:
    module = module_of("signal", ["step", "sample", "OK"], tmp_path)
    model = model_of(module, name, integrals={"grown": "filled"})
    files = c(Machine(model, numbers_of(module)), tmp_path / "made", STEP)
    sources = {file.name: file.read_text("utf-8") for file in files}
    compiled(sources, ["-O0", "-I."], program="example")
    header = next(file for file in sources if file.endswith(".h") and "_values" not in file)
    read_as_cpp(sources[header], tmp_path)
    content = content_of(Machine(model, numbers_of(module)), STEP)  # as an FMU has it
    compiled(interface(content.exported), ["-O0"])
