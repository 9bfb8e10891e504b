"""Words that make no sense, and places that cannot be written."""

import shlex

import pytest

REFUSED = {
    "simulate hoist step:4 --set orifice=2": "orifice ... design variable",
    "whatif hoist --scale motor_leakage=2": "motor_leakage ... value",
    "simulate hoist stairs:2,4,0": "stairs:2/4/0",
    "bode hoist --points 1": "--points ... 1... 2 to 2000",
    "bode hoist --from 2 --to 1": "0 Hz... 2 to 1",
    "bode hoist --amplitude 0.05": "0 V... 0.05",
    "compare hoist slew --maneuver hop --out both.csv": "one of the tests of hoist",
    "compensate hoist --speed-deg-s 200": "hoist ... 200 deg/s",
    "compensate hoist --speed-deg-s 200 --units rpm": "-30.8326 rpm ... 32.6662 rpm",
    "show hoist --units m/min --drum 0": "diameter ... 0 m",
    "show hoist --units rpm,deg/s": "rpm and deg/s",
    "whatif hoist --scale pump=1.2 --out w.csv": "w.csv... .toml",
    "export hoist --c folder --step 0.005": "several times per sample",
    "linearize hoist": "--at and --current",
    "linearize hoist --current 1 --input voltage": "--at",
    "linearize hoist --at 0.1": "card's dead zone... +0.",
    "sensitivity hoist --variable pumpe": "'pumpe' ... pump?",
    "sensitivity hoist --variable pump --variable pump=1/2": "--variable ... pump",
    "sensitivity hoist --outcome speed": "outcome 'speed'",
    "size hoist --speed-deg-s 500": "hoist ... speed 370 deg/s ... 500 deg/s",
    "size hoist --tracking-deg-s 5": "--tracking-deg-s and --maneuver",
    "whatif hoist --scale orifise=1.5": "'orifise' ... orifice?",
    "whatif hoist --scale pump=2 --uncertainty none": "fit.json ... none",
    "full-order neutral": "neutral: spool_stroke ... inf m",
    "full-order hoist --plot run.png": "--plot ... maneuver",
    "full-order hoist --physical oil_volume": "--physical ... 'oil_volume'",
    "simulate crane step:9": "set, file or folder 'crane'... hoist, slew",
    "simulate none.toml step:9": "none.toml",
    "simulate hoist stepp:9": "'stepp' ... rest, step",
    "simulate hoist 'step +8 V'": 'multisine... tests of hoist... "step +9',
    "simulate hoist step": "'amplitude'... amplitude, start, stop, length",
    "simulate hoist step:9 --set z16=1e-4": "Z16?",
    "simulate hoist step:9 --set Z16": "--set ... 'Z16'... Z16=1.2e-4",
    "simulate hoist step:9 --set Z16=nan": "Z16_plus ... nan",
    "simulate hoist step:9 --set Z13_plus=-0.2": "Z13_plus ... -0.2 rad",
    "simulate hoist step:9 --set 'Z16=1 bar'": "Z16... 'bar'... m",
    "simulate hoist step:9 --scale Z16=1.5mm": "--scale ... 'Z16=1.5mm'",
    "simulate hoist step:9 --scale orifise=2": "orifice?... orifice",
    "compensate hoist 97.75": "--speed-deg-s 97.75",
    "size hoist": "speed, an acceleration, a tracking error",
    "simulate hoist step:9 --scale Z1=1/2": "Z1 ... one factor... 2",
    "size hoist --speed-deg-s 250 --out no/a.toml": "folder no ",
    "compensate hoist --out a.xlsx": "a.xlsx... .toml, .csv or .parquet",
    "show --toml": "drive to show",
    "advise hoist --from slew": "--from ... campaign... hoist",
    "advise hoist --runs runs.csv": "--runs ... campaign",
    "advise none.toml --out no/a.csv": "folder no ",
    "campaign plot none.toml --out a.gif": ".png, .svg or .pdf",
    "simulate hoist step:11 --out run.csv": "11 V ... 1 s... ±10 V",
    "export hoist": "--fmu FILE.fmu, --c DIR or --wasm FILE.wasm",
    "export hoist --compile --fmu a.fmu": "--c DIR",
    "export hoist --platforms win64 --c f": "--platforms ... FMU",
    "export hoist --fmu a.zip": "a.zip... .fmu",
    "export hoist --wasm a.js": "a.js... .wasm",
    "export hoist --fmu a.fmu --platforms win32": "platform 'win32'",
    "rig hoist --out x --set wobble=1": "parameter 'wobble'",
    "rig hoist --out x --backlash-deg -1": "backlash ... 0 ",
}
"""What is typed, and what the sentence that refuses it must name, parts separated by dots."""


@pytest.mark.parametrize("typed", REFUSED)
def test_a_sentence(refused, typed):
    sentence = refused(*shlex.split(typed))
    for part in REFUSED[typed].split("..."):
        assert part in sentence


@pytest.mark.parametrize(
    ("typed", "file"),
    [
        ("simulate hoist rest:1 --out {}", "a.csv"),
        ("whatif hoist --scale pump=1.1 --maneuver step:1 --out {}", "a.toml"),
        ("export hoist --fmu {}", "a.fmu"),
        ("rig hoist --maneuver rest:1 --out {}", "logs/a.csv"),
        ("demo --out {}", "mine/drive.toml"),
    ],
)
def test_what_is_there_is_replaced_with_force_alone(refused, done, tmp_path, typed, file):
    place = tmp_path / "there" / file
    place.parent.mkdir(parents=True)
    place.write_text("old")
    named = place.parent if "/" in file else place
    words = typed.format(named).split()
    said = refused(*words)
    assert str(named) in said
    assert "--force" in said
    assert place.read_text() == "old"
    if place is named:
        done(*words, "--force")
        assert place.read_bytes() != b"old"


@pytest.mark.parametrize("option", ["--out", "--plot"])
@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("run.doc", "run.doc "),
        ("missing/run.{}", "folder missing "),
        ("folder.{}", "it is a folder"),
    ],
)
def test_nothing_is_written_where_one_place_cannot_be(refused, tmp_path, option, name, said):
    endings = {"--out": "csv", "--plot": "png"}
    (tmp_path / f"folder.{endings[option]}").mkdir()
    other, ending = next(each for each in endings.items() if each[0] != option)
    words = (option, name.format(endings[option]), other, f"run.{ending}")
    assert said in refused("compare", "hoist", "slew", *words)


@pytest.mark.parametrize("content", [b"", b"name = ", b"\x00\xff"])
def test_a_bad_set(refused, tmp_path, content):
    (tmp_path / "mine.toml").write_bytes(content)
    assert "mine.toml" in refused("simulate", "mine.toml", "step:9")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "Usage: swashplate"),
        (("simul",), "Did you mean 'simulate'?"),
        (("simulate", "hoist", "step:9", "--start", "bed"), "'rest', 'steady'"),
        (("simulate", "hoist", "step:9", "--nonsense"), "--nonsense"),
        (("simulate", "hoist", "step:9", "step:8"), "step:8"),
    ],
)
def test_usage(run, words, said):
    result = run(*words)
    assert result.exit_code == 2
    # typer draws a frame around what it says and breaks its lines
    assert said in " ".join(result.output.replace("│", " ").split())
    assert "Traceback" not in result.output


def test_too_little_memory_is_a_sentence(refused, monkeypatch):
    def exhausted(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr("swashplate.Drive.simulate", exhausted)
    assert "not enough memory" in refused("simulate", "hoist", "step:9")
