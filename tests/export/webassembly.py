"""An exported model as WebAssembly, run by wasmtime."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from swashplate.export.libraries import VALUES_SECTION


class Page:
    """A file that `swashplate.export.wasm` wrote, with the numbers in it."""

    def __init__(self, path: Path) -> None:
        wasmtime = pytest.importorskip("wasmtime")
        content = path.read_bytes()
        self.store = wasmtime.Store()
        module = wasmtime.Module(self.store.engine, content)
        assert not module.imports
        self.own = wasmtime.Instance(self.store, module, []).exports(self.store)
        values = content.partition(VALUES_SECTION.encode())[2]
        self.write(values, self.call("values", len(values) // 8))
        assert self.call("init", len(values) // 8) == 0

    def call(self, function: str, *words: float) -> int:
        return self.own[f"swp_page_{function}"](self.store, *words)

    def write(self, content: bytes, at: int) -> None:
        self.own["memory"].write(self.store, content, at)

    def run(
        self, inputs: Sequence[np.ndarray], step: float, outputs: Sequence[int], settled: int = 0
    ) -> np.ndarray:
        """A row for each output."""
        size = inputs[0].size
        assert self.call("begin", size, step, len(outputs)) == 0
        for place, output in enumerate(outputs):
            self.call("select", place, output)
        for which, values in enumerate(inputs):
            self.write(values.astype("<f8").tobytes(), self.call("input", which))
        assert self.call("run", settled) == 0
        rows = [self.call("row", place) for place in range(len(outputs))]
        memory = self.own["memory"]
        return np.array([np.frombuffer(memory.read(self.store, at, at + 8 * size)) for at in rows])
