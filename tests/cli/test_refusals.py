"""Words that make no sense, and places that cannot be written."""

import pytest


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("crane", "step:9"), "no packaged set, file or folder 'crane'; packaged are hoist, slew"),
        (("none.toml", "step:9"), "There is no file none.toml"),
        (("sub/none", "step:9"), "There is no file sub/none"),
        (("hoist", "stepp:9"), "'stepp' is no maneuver: choose one of rest, step"),
        (
            ("hoist", "step +8 V"),
            'multisine; or name one of the tests of hoist, such as "step +9 V".',
        ),
        (("neutral", "step +9 V"), "is no maneuver: choose one of rest, step"),
        (("hoist", "step"), "'amplitude'; step takes amplitude, start, stop, length; or name one"),
        (("hoist", "step:x"), "'x' is not a number"),
        (("hoist", "step:9,stop=-1"), "a step needs 0 <= start < stop <= length"),
        (("hoist", "step:9,top=3"), "step takes amplitude, start, stop, length"),
        (("hoist", "step:nan"), "amplitude must be finite"),
        (("hoist", "step:inf"), "amplitude must be finite"),
        (("hoist", "sine:4,-1"), "frequency must be positive"),
        (("hoist", "step:10.5"), "The voltage is 10.5 V at 1 s, but the card takes ±10 V"),
        (("hoist", "step:1,length=10.001"), "a whole number"),
        (("hoist", "rest:1e9"), "more than the 1e+08 that are simulated at once"),
        (("hoist", "rest:1e30"), "more than the 1e+08 that are simulated at once"),
        (("hoist", "step:9", "--rate", "9.9"), "must be between 10 and 100000 Hz"),
        (("hoist", "step:9", "--rate", "100001"), "must be between 10 and 100000 Hz"),
        (("hoist", "step:9", "--rate", "1e12"), "must be between 10 and 100000 Hz"),
        (("hoist", "step:9", "--rate", "-512"), "The rate is -512 Hz"),
        (("hoist", "step:9", "--rate", "0"), "The rate is 0 Hz"),
        (("hoist", "step:9", "--rate", "nan"), "The rate is nan Hz"),
        (("hoist", "step:9", "--rate", "inf"), "The rate is inf Hz"),
    ],
)
def test_drive_command_and_rate(refused, words, said):
    assert said in refused("simulate", *words, "--out", "run.csv", "--plot", "run.png")


@pytest.mark.parametrize(
    ("option", "word", "said"),
    [
        ("--set", "Zz=1", "There is no parameter 'Zz'"),
        ("--set", "z16=1e-4", "did you mean Z16?"),
        ("--set", "Z16", "--set cannot read 'Z16'; write it as Z16=1.2e-4"),
        ("--set", "Z16=", "cannot read 'Z16='"),
        ("--set", "=1", "There is no parameter ''"),
        ("--set", "Z16=abc", "cannot read 'Z16=abc'"),
        ("--set", "Z16=1,5", "cannot read 'Z16=1,5'"),
        ("--set", "Z16=1.2.3", "cannot read 'Z16=1.2.3'"),
        ("--set", "Z16=1/2/3", "cannot read 'Z16=1/2/3'"),
        ("--set", "Z16=nan", "Z16_plus (opening at which the orifice limits the flow) is nan m"),
        ("--set", "Z1=inf", "Z1 (pressure to swash plate tangent) is inf 1/Pa"),
        ("--set", "Z13_plus=-0.2", "(stop of the swash plate) is -0.2 rad, but must be above 0"),
        ("--set", "Z16=1 bar", "'bar', which does not measure the same as m"),
        ("--set", "Z16=1 smoot_of_no_kind", "unknown unit"),
        ("--set", "Z1=1/2", "Z1 has one value, not a plus and a minus one"),
        ("--set", "Z16_plus=1/2", "Z16_plus has one value"),
        ("--set", "Z19=100", "the solenoid would overpower the feedback spring"),
        ("--scale", "Zz=2", "There is no parameter 'Zz'"),
        ("--scale", "Z16=1.5mm", "--scale cannot read 'Z16=1.5mm'; write it as Z16=1.5"),
        ("--scale", "Z16=x", "--scale cannot read 'Z16=x'"),
        ("--scale", "Z16=-1", "must be above 0"),
        ("--scale", "Z1=1/2", "takes one factor, not two"),
    ],
)
def test_changes(refused, option, word, said):
    assert said in refused("simulate", "hoist", "step:9", option, word, "--out", "run.csv")


@pytest.mark.parametrize("option", ["--set", "--scale"])
def test_a_change_is_given_once(refused, option):
    words = ("simulate", "hoist", "step:9", option, "Z16=1", option, "Z16=2")
    assert f"{option} gives Z16 twice" in refused(*words)


@pytest.mark.parametrize("option", ["--out", "--plot"])
@pytest.mark.parametrize("command", ["simulate", "compare"])
@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("run.doc", "run.doc ends in '.doc'"),
        ("run", "run ends in ''"),
        ("missing/run.{}", "cannot be written: folder missing does not exist"),
        ("file/run.{}", "cannot be written: file is no folder"),
        ("folder.{}", "cannot be written: it is a folder"),
    ],
)
def test_places_that_cannot_be_written(refused, tmp_path, command, option, name, said):
    ending = "csv" if option == "--out" else "png"
    (tmp_path / "file").write_text("")
    (tmp_path / f"folder.{ending}").mkdir()
    words = (command, "hoist", "step:9") if command == "simulate" else (command, "hoist", "slew")
    assert said in refused(*words, option, name.format(ending))


def test_an_older_file_stays_when_the_record_is_refused(refused, tmp_path):
    (tmp_path / "run.csv").write_text("old")
    refused("simulate", "hoist", "step:11", "--out", "run.csv")
    assert (tmp_path / "run.csv").read_text() == "old"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "mine.toml"),
        ("name = ", "mine.toml is not TOML"),
        ("\x00\xff", "mine.toml"),
    ],
)
@pytest.mark.parametrize("command", ["show", "simulate"])
def test_a_bad_set(refused, tmp_path, command, text, said):
    (tmp_path / "mine.toml").write_bytes(text.encode("latin-1"))
    words = ("step:9",) if command == "simulate" else ()
    assert said in refused(command, "mine.toml", *words)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "Usage: swashplate"),
        (("simul",), "Did you mean 'simulate'?"),
        (("simulate",), "Missing argument"),
        (("simulate", "hoist", "step:9", "--start", "bed"), "'rest', 'steady'"),
        (("simulate", "hoist", "step:9", "--interpolation", "cubic"), "'linear', 'previous'"),
        (("simulate", "hoist", "step:9", "--rate", "fast"), "Invalid value for '--rate'"),
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
    def exhausted(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr("swashplate.cli.simulate.simulated", exhausted)
    assert "not enough memory" in refused("simulate", "hoist", "step:9")
