"""Machine code of functions in LLVM's language, made once on a machine and kept on disk.

All are made by the same passes for the same processor, so that numbers are the same to the last bit
wherever an equation is compiled.
"""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import CFUNCTYPE, addressof, c_char, c_double, c_int64, c_void_p
from functools import cache
from threading import RLock
from typing import Any

import numpy as np
from llvmlite import __version__ as llvmlite_version
from llvmlite import binding as llvm
from numpy.typing import NDArray

from swashplate import progress
from swashplate.environment import told_processor
from swashplate.machine.cache import COMPILING
from swashplate.machine.keeping import cached_on_disk

_COMPILING = RLock()
"""Held while LLVM works for this process."""
SYMBOL = "code"
"""Name of every function within its own module."""
OPTIMISATION_LEVEL = 3
"""Of optimisation."""


def address_of(array: NDArray[Any]) -> int:
    """Where the numbers of an array begin, 0 if it has none: NumPy's own way takes longer."""
    if not array.size:
        return 0
    try:
        # an array offers its buffer, which NumPy's types do not say on Python 3.11
        buffer: Any = array
        return addressof(c_char.from_buffer(buffer))
    except TypeError:  # read-only
        return int(array.ctypes.data)


class MachineCode:
    """A function's machine code: it is called with numbers and arrays, and by others at `address`.

    It is never unloaded.
    """

    def __init__(self, content: bytes, kinds: Sequence[str]) -> None:
        with _COMPILING:
            self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target_machine())
            self._engine.add_object_file(llvm.ObjectFileRef.from_data(content))
            self._engine.finalize_object()
            self.address: int = self._engine.get_function_address(SYMBOL)
        types: dict[str, Any] = {"int": c_int64, "float": c_double}
        prototype = CFUNCTYPE(None, *(types.get(kind, c_void_p) for kind in kinds))
        self._function = prototype(self.address)

    def __call__(self, *arguments: Any) -> None:
        """Run it, without the interpreter's lock."""
        self._function(
            *(
                address_of(argument) if isinstance(argument, np.ndarray) else argument
                for argument in arguments
            )
        )


_loaded: dict[tuple[str, str, tuple[str, ...], bool], MachineCode] = {}


def code_of_text(name: str, text: str, kinds: tuple[str, ...], *, pack: bool = True) -> MachineCode:
    """Machine code of a function that returns nothing.

    Parameters
    ----------
    name : str
        Of what is compiled, for a person who waits, and for the file.
    text : str
        A module in LLVM's language, with the function by the name of `SYMBOL`.
    kinds : tuple of str
        Of the arguments: ``int``, ``float``, and with ``*`` before them arrays of these.
    pack : bool
        Whether operations on numbers that are alike become one on a vector. It takes a third of the
        time to compile, and finds nothing in what is written for vectors.
    """
    key = (name, text, kinds, pack)
    if key not in _loaded:
        content = cached_on_disk(
            f"{name}_code",
            (*key, OPTIMISATION_LEVEL, llvmlite_version, llvm.llvm_version_info, *_host()),
            lambda: _compiled(name, text, pack=pack),
            by_engine=False,
        )
        _loaded[key] = MachineCode(content, kinds)
    return _loaded[key]


@cache
def _host() -> tuple[str, str, str]:
    """The machine that code is made for: triple, processor, and what that can do."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    triple, told = llvm.get_process_triple(), told_processor()
    if told and told != "host":
        return triple, told, ""
    return triple, llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


def _target_machine() -> Any:
    """LLVM's generator of machine code for this processor."""
    triple, processor, features = _host()
    target = llvm.Target.from_triple(triple)
    return target.create_target_machine(
        cpu=processor,
        features=features,
        opt=OPTIMISATION_LEVEL,
        reloc="static" if target.name.startswith("x86") else "default",
        codemodel="jitdefault",
        jit=True,
    )


def _passes(machine: Any, *, pack: bool) -> Any:
    """What optimises: operations become vector instructions, and stay as they are written."""
    options = llvm.create_pipeline_tuning_options(speed_level=OPTIMISATION_LEVEL)
    options.loop_vectorization, options.slp_vectorization = True, pack
    return llvm.create_pass_builder(machine, options)


def optimised(text: str, *, pack: bool = True) -> Any:
    """A module of LLVM's, in the form in which it becomes machine code."""
    with _COMPILING:
        machine, module = _target_machine(), llvm.parse_assembly(text)
        module.triple, module.data_layout = machine.triple, str(machine.target_data)
        module.verify()
        for function in module.functions:
            passes = _passes(machine, pack=pack)
            passes.getFunctionPassManager().run(function, passes)
        passes = _passes(machine, pack=pack)
        passes.getModulePassManager().run(module, passes)
        return module


def _compiled(name: str, text: str, *, pack: bool) -> bytes:
    """Object code of a module."""
    work = progress.begin(COMPILING, name)
    try:
        module = optimised(text, pack=pack)
        with _COMPILING:
            content: bytes = _target_machine().emit_object(module)
        return content
    finally:
        progress.end(work)
