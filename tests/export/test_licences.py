"""Every export carries the licences of what is in it, as texts."""

import zipfile
from pathlib import Path

import pytest

from swashplate import Drive, export

ROOT = Path(__file__).parents[2]
OWN = "Redistributions in binary form must reproduce the above copyright notice"
OTHERS = {
    "Zig": "Copyright (c) Zig contributors",
    "mingw-w64": "Copyright (c) 2009 - 2013 by the mingw-w64 project",
    "the ZPL's disclaimer": "ADVISED OF THE POSSIBILITY OF SUCH DAMAGE",
    "musl": "Copyright © 2005-2020 Rich Felker, et al.",
    "MIT, for wasi-libc": "Permission is hereby granted, free of charge, to any",
}


def words(text: str) -> str:
    """A text on one line, without the marks of a quotation."""
    return " ".join(text.replace("\n>", "\n").split())


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_an_fmu(fmi: str, tmp_path: Path) -> None:
    with zipfile.ZipFile(export.fmu(Drive.preset("hoist"), tmp_path / "a.fmu", fmi=fmi)) as opened:
        own = words(opened.read("documentation/licenses/license.txt").decode())
        others = words(opened.read("documentation/licenses/THIRD_PARTY.txt").decode())
    assert OWN in own
    assert "Copyright (c) 2026, the swashplate developers" in own
    assert {name for name, text in OTHERS.items() if text not in others} == set()


def test_a_folder_of_c(tmp_path: Path) -> None:
    files = export.c(Drive.preset("hoist"), tmp_path / "hoist")
    assert tmp_path / "hoist" / "LICENSE.txt" in files
    assert OWN in words((tmp_path / "hoist" / "LICENSE.txt").read_text("utf-8"))


def test_webassembly(tmp_path: Path) -> None:
    wasmtime = pytest.importorskip("wasmtime")
    content = export.wasm(Drive.preset("hoist"), tmp_path / "hoist.wasm").read_bytes()
    wasmtime.Module(wasmtime.Engine(), content)  # it is still a module
    text = words(content.partition(b"swashplate.licenses")[2].decode("utf-8", "ignore"))
    assert OWN in text
    assert {name for name, other in OTHERS.items() if other not in text} == set()


def test_the_texts_are_those_of_the_repository() -> None:
    packaged = ROOT / "src" / "swashplate" / "export" / "licenses"
    for here, there in (("LICENSE", "LICENSE.txt"), ("THIRD_PARTY.md", "THIRD_PARTY.txt")):
        assert (packaged / there).read_bytes() == (ROOT / here).read_bytes()
