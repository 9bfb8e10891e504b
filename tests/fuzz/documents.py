"""Campaigns, drives, fit setups and cranes as nobody should write them."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from swashplate import Campaign, Drive, SwashplateError
from swashplate.crane import Crane, preset_text
from swashplate.identification import load_setup

QUOTED = ".".join(['"a"'] * 20_000)
VALUES = (
    *("true", "false", '"36"', "''", "0", "-1", "1", "1e308", "-1e308", "1e-308", "nan", "-inf"),
    *("9" * 30, "9" * 5000, f"0x{'f' * 100_000}", f"0b{'1' * 100_000}", "1979-05-27", "07:32:00"),
    *("[]", "[[]]", "{}", "[1, 2, 3]", "[true, 1.0]", '["a"]', "{ a = 1 }", f"{{ {QUOTED} = 1 }}"),
    *('"\\uFFFE"', '"\\uFFFF"', '"\\u001b[31m"', '"\\u202e"', '"\\u0000"', '"*\\\\\\n/"', '"=1+1"'),
    *(f'"{"x" * 100_000}"', '"../../etc/passwd"', '"/dev/zero"', '"."', '"os:system"', "[" * 300),
    *('"V**-0"', '"0 V"', '"1e400 V"', '"V**9**9**9"', '"nan"', '"degC"', '"rad/s"', '"bar"'),
    '[{ old = "os:system", new = "os:system", parameters = "os:environ" }]',
    '[{ old = "swashplate.models.pump:shaft_speed", new = "json:dumps" }]',
)
"""What stands in the place of a value."""
LINES = (
    f"{QUOTED} = 1",
    f"[{QUOTED}]",
    f"[[{QUOTED}]]",
    "[axes.a.channels.b]",
    "[model]\nequations = [{}]",
    '"" = 1',
    "# \\",
    "\x00",
    "[[runs]]",
    "[[stages]]",
    'stages = ["a"]',
    "=",
)
UNITS = ("V", "V**-0", "V^0", "0 V", "1e400 V", "V**9**9**9", "[V]", "%", "nan", "V;", "lambda")
CAMPAIGN = """
title = "Hoist"
[axes.hoist]
drive = "hoist"
time = { column = "time", unit = "s", offset = 0.0 }
input = { column = "voltage", scale = 1.0, sign = 1, missing = "drop" }
[axes.hoist.channels.speed]
kind = "shaft_speed"
column = "speed"
weight_by_input = [[3, 1], [10, 0.5]]
ignore = [{ from = 0.1, to = 0.2, why = "spike" }]
[[runs]]
file = "log.csv"
role = "fit"
[runs.axes.hoist.channels.speed]
weight = 2.0
"""
SETUP = """
title = "card and pump"
part = "chain"
channels = ["rectified_current"]
start_pressure = 1e5
[free]
J = { relative = [0.5, 2.0], log = true }
omega = { bounds = [1.0, 100.0], tied = true, prior = { mean = 30.0, deviation = 3.0 } }
[forces]
plus = [0.1, 0.2, 0.3, 0.4]
minus = [0.1, 0.2, 0.3, 0.4]
[standard_uncertainty]
Z9 = "5 %"
"""
VALUE = re.compile(r"(?<== )(?:\"[^\"\n]*\"|\[[^\n]*?\]|[\w.+-]+)")
PATIENCE = 5.0
"""CPU time of a document. [s]"""


def log(random: np.random.Generator) -> str:
    """A log whose header has units that may be none."""
    units = random.choice(UNITS, 2)
    rows = "".join(f"{0.01 * k:.2f},{k % 3},{0.1 * k:.1f}\n" for k in range(50))
    return f"time [s],voltage [{units[0]}],speed [{units[1]}]\n{rows}"


def _crane(path: Path) -> object:
    return Crane.from_toml(path)


READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "campaign": ("campaign.toml", Campaign.from_toml),
    "drive": ("drive.toml", Drive.from_toml),
    "setup": ("setup.toml", load_setup),
    "crane": ("crane.toml", _crane),
}
"""File and reader, by kind."""


def valid(kind: str, folder: Path) -> str:
    """A valid text of a kind."""
    if kind == "drive":
        Drive.preset("hoist").to_toml(folder / "valid.toml")
        return (folder / "valid.toml").read_text("utf-8")
    if kind == "crane":
        return preset_text("tg3637")
    return CAMPAIGN if kind == "campaign" else SETUP


def spoiled(text: str, random: np.random.Generator) -> str:
    """A document after one to three changes of values, lines and letters."""
    for _ in range(random.integers(1, 4)):
        what = random.integers(5)
        lines = text.split("\n")
        number = int(random.integers(len(lines)))
        if what <= 1 and (matches := [*VALUE.finditer(text)]):
            match = matches[random.integers(len(matches))]
            text = text[: match.start()] + str(random.choice(VALUES)) + text[match.end() :]
        elif what == 2:
            lines.insert(number, str(random.choice(LINES)))
            text = "\n".join(lines)
        elif what == 3:
            lines[number] = lines[int(random.integers(len(lines)))]
            text = "\n".join(lines)
        else:
            position = int(random.integers(len(text)))
            letter = chr(random.choice([*range(128), 0xFFFE, 0x2028, 0x1F600]))
            text = text[:position] + letter + text[position + 1 :]
    return text


def read_document(kind: str, folder: Path, text: str, random: np.random.Generator) -> None:
    """Read a document: it is taken, or refused in one sentence, and soon."""
    name, reader = READERS[kind]
    path = folder / name
    path.write_text(text, "utf-8")
    (folder / "log.csv").write_text(log(random), "utf-8")
    begin = time.process_time()
    try:
        reader(path)
    except SwashplateError as error:
        sentence = " ".join(str(error).split())  # a name may go over two lines
    else:
        sentence = "It is taken."
    assert sentence.endswith("."), sentence
    assert sentence.isprintable(), sentence
    assert len(sentence) < 2000, len(sentence)
    assert "environ" not in sentence or "os:environ" in sentence, sentence
    assert time.process_time() - begin < PATIENCE, f"{time.process_time() - begin:.1f} s"
