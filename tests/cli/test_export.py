"""`swashplate export` writes files that others read, and refuses what it cannot."""

import zipfile
from importlib.util import find_spec
from shutil import which

import pytest

from swashplate import Drive


def test_writes_an_fmu(done, tmp_path):
    assert done("export", "hoist", "--fmu", "hoist.fmu").split() == ["FMU", "2.0:", "hoist.fmu"]
    names = zipfile.ZipFile(tmp_path / "hoist.fmu").namelist()
    assert {"modelDescription.xml", "resources/drive.bin", "sources/fmi2.c"} <= set(names)


def test_writes_fmi_3_for_chosen_platforms(done, tmp_path):
    words = ("--fmi", "3", "--platforms", "linux64, win64", "--scale", "Z16=1.5")
    said = done("export", "hoist", "--fmu", "a.fmu", *words)
    assert "FMU 3.0: a.fmu" in said
    assert "Z16" in said
    with zipfile.ZipFile(tmp_path / "a.fmu") as made:
        libraries = [name for name in made.namelist() if name.startswith("binaries/")]
        text = made.read("modelDescription.xml").decode()
    assert [each.split("/")[1] for each in libraries] == ["x86_64-linux", "x86_64-windows"]
    assert repr(1.5 * Drive.preset("hoist")["Z16"].value.plus) in text


def test_says_what_it_warns_of(done):
    said = done("export", "hoist", "--step", "0.001", "--fmu", "a.fmu", "--platforms", "linux64")
    assert "Note: hoist: the card's filter is a recursion for 512 Hz" in " ".join(said.split())
    assert "below 1.5 steps" in done("export", "neutral", "--fmu", "b.fmu")


def test_older_files_stay_unless_forced(run, tmp_path):
    (tmp_path / "a.fmu").write_text("mine", "utf-8")
    refused = run("export", "hoist", "--fmu", "a.fmu")
    assert refused.exit_code == 2
    assert "exists already" in refused.stderr
    assert (tmp_path / "a.fmu").read_text("utf-8") == "mine"
    assert run("export", "hoist", "--fmu", "a.fmu", "--force").exit_code == 0
    assert zipfile.is_zipfile(tmp_path / "a.fmu")


def test_writes_c_and_compiles_it(done, tmp_path):
    if not which("cc") and find_spec("ziglang") is None:
        pytest.skip("there is no C compiler")
    said = done("export", "slew", "--c", "folder", "--compile")
    (header,) = (tmp_path / "folder").glob("*drive.h")
    library = tmp_path / "folder" / f"{header.stem}.so"
    assert library.exists()
    assert f"C: folder/{library.name}" in said


def test_writes_webassembly_with_the_drives_numbers(done, tmp_path):
    wasmtime = pytest.importorskip("wasmtime")
    assert "WebAssembly: a.wasm" in done("export", "hoist", "--wasm", "a.wasm")
    content = (tmp_path / "a.wasm").read_bytes()
    store = wasmtime.Store()
    module = wasmtime.Module(store.engine, content)
    assert module.imports == []
    assert b"swashplate.values" in content


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ((), "Say what to export: --fmu FILE.fmu, --c DIR or --wasm FILE.wasm"),
        (("--compile", "--fmu", "a.fmu"), "name its folder with --c DIR"),
        (("--platforms", "win64", "--c", "f"), "--platforms is of an FMU"),
        (("--fmu", "a.zip"), "an FMU is written as .fmu"),
        (("--wasm", "a.js"), "WebAssembly is written as .wasm"),
        (("--fmu", "no/a.fmu"), "folder no does not exist"),
        (("--fmu", "a.fmu", "--platforms", "win32"), "no platform 'win32'"),
        (("--fmu", "a.fmu", "--step", "0.1"), "at most 1/512 s"),
        (("--fmu", "a.fmu", "--set", "tau=9"), "line holds 1020 steps"),
    ],
)
def test_refuses_in_a_sentence(run, tmp_path, words, sentence):
    refused = run("export", "hoist", *words)
    assert refused.exit_code == 2
    assert sentence in " ".join(refused.stderr.split())
    assert list(tmp_path.iterdir()) == []
