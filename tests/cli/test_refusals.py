"""Words that make no sense, and places that cannot be written."""

import shlex

import pytest

REFUSED = {
    "simulate hoist step:4 --set orifice=2": "orifice is a design variable, which has no value",
    "whatif hoist --scale motor_leakage=2": "motor_leakage has no value here",
    "simulate hoist stairs:2,4,0": "separate levels by /, as in stairs:2/4/0",
    "bode hoist --points 1": "--points is 1, but must be 2 to 2000",
    "bode hoist --from 2 --to 1": "must rise from above 0 Hz, not 2 to 1",
    "bode hoist --amplitude 0.05": "nothing moves about 0 V",
    "compare hoist slew --maneuver hop --out both.csv": "one of the tests of hoist",
    "compensate hoist --speed-deg-s 200": "hoist cannot settle at 200 deg/s",
    "compensate hoist --speed-deg-s 200 --units rpm": "reach from -30.8326 rpm to 32.6662 rpm.",
    "show hoist --units m/min --drum 0": "diameter must be above 0 m, not 0",
    "show hoist --units rpm,deg/s": "two units of one quantity, rpm and deg/s",
    "whatif hoist --scale pump=1.2 --out w.csv": "a parameter file is written as .toml",
    "export hoist --c folder --step 0.005": "call swp_step several times per sample",
    "linearize hoist": "give one of --at and --current",
    "linearize hoist --current 1 --input voltage": "needs --at, not",
    "linearize hoist --at 0.1": "is in the card's dead zone, so the gain is 0; linearise at +0.",
    "sensitivity hoist --variable pumpe": "no design variable 'pumpe' (did you mean pump?)",
    "sensitivity hoist --variable pump --variable pump=1/2": "--variable gives pump twice",
    "sensitivity hoist --outcome speed": "There is no outcome 'speed'",
    "size hoist --speed-deg-s 500": "the hoist reaches speed 370 deg/s (required 500 deg/s)",
    "size hoist --tracking-deg-s 5": "--tracking-deg-s and --maneuver belong together",
    "whatif hoist --scale orifise=1.5": "no design variable 'orifise' (did you mean orifice?)",
    "whatif hoist --scale pump=2 --uncertainty none": "There is no fit.json in none",
    "full-order neutral": "neutral: spool_stroke (stroke of the spool, both ways) is inf m",
    "full-order hoist --plot run.png": "--plot draws one run; name a maneuver",
    "full-order hoist --physical oil_volume": "--physical cannot read 'oil_volume'; write",
    "simulate crane step:9": "no packaged set, file or folder 'crane'; packaged are hoist, slew",
    "simulate none.toml step:9": "There is no file none.toml",
    "simulate hoist stepp:9": "'stepp' is not a maneuver: choose one of rest, step",
    "simulate hoist 'step +8 V'": 'multisine; or name one of the tests of hoist, such as "step +9',
    "simulate hoist step": "'amplitude'; step takes amplitude, start, stop, length; or name one",
    "simulate hoist step:9 --set z16=1e-4": "did you mean Z16?",
    "simulate hoist step:9 --set Z16": "--set cannot read 'Z16'; write it as Z16=1.2e-4",
    "simulate hoist step:9 --set Z16=nan": "Z16_plus (opening at which the orifice limits the",
    "simulate hoist step:9 --set Z13_plus=-0.2": "(stop of the swash plate) is -0.2 rad, but must",
    "simulate hoist step:9 --set 'Z16=1 bar'": "'bar', which does not measure the same as m",
    "simulate hoist step:9 --scale Z16=1.5mm": "--scale cannot read 'Z16=1.5mm'; write it as",
    "simulate hoist step:9 --scale orifise=2": "(did you mean orifice?); there are orifice",
    "compensate hoist 97.75": "--speed-deg-s 97.75",
    "size hoist": "give a speed, an acceleration, a tracking error",
    "simulate hoist step:9 --scale Z1=1/2": "takes one factor, not 2",
    "size hoist --speed-deg-s 250 --out no/a.toml": "folder no does not",
    "compensate hoist --out a.xlsx": "written as .toml, .csv or .parquet",
    "show --toml": "Name the drive to show",
    "advise hoist --from slew": "--from needs a campaign: hoist is a drive without tests",
    "advise hoist --runs runs.csv": "--runs needs a campaign",
    "advise none.toml --out no/a.csv": "folder no does not exist",
    "campaign plot none.toml --out a.gif": ".png, .svg or .pdf",
    "simulate hoist step:11 --out run.csv": "11 V at 1 s, but the card takes ±10 V; check its unit",
    "export hoist": "Choose what to export: --fmu FILE.fmu, --c DIR or --wasm FILE.wasm",
    "export hoist --compile --fmu a.fmu": "name its folder with --c DIR",
    "export hoist --platforms win64 --c f": "--platforms applies only to an FMU",
    "export hoist --fmu a.zip": "an FMU is written as .fmu",
    "export hoist --wasm a.js": "WebAssembly is written as .wasm",
    "export hoist --fmu a.fmu --platforms win32": "no platform 'win32'",
    "rig hoist --out x --set wobble=1": "no parameter 'wobble'",
    "rig hoist --out x --backlash-deg -1": "backlash must be 0 or more",
}
"""What is typed, and what the sentence that refuses it says."""


@pytest.mark.parametrize("typed", REFUSED)
def test_a_sentence(refused, typed):
    assert REFUSED[typed] in refused(*shlex.split(typed))


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
        ("run.doc", "run.doc ends in '.doc'"),
        ("missing/run.{}", "cannot be written: folder missing does not exist"),
        ("folder.{}", "cannot be written: it is a folder"),
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
