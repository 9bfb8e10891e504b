"""Tables out, whole or not at all."""

import polars as pl
import pytest

from swashplate import FileError
from swashplate.tables import FIGURE, check_place, ending, write_table, write_text
from swashplate.tables import TABLE as TABLES

TABLE = pl.DataFrame({"time": [0.0, 0.5], "voltage": [1.25, -2.0]})


def test_csv(tmp_path):
    write_table(TABLE, tmp_path / "run.csv")
    assert (tmp_path / "run.csv").read_text("utf-8") == "time,voltage\n0.0,1.25\n0.5,-2.0\n"


@pytest.mark.parametrize("name", ["run.parquet", "run.PQ"])
def test_parquet(tmp_path, name):
    write_table(TABLE, tmp_path / name)
    assert pl.read_parquet(tmp_path / name).equals(TABLE)


def test_another_ending_is_refused(tmp_path):
    with pytest.raises(
        FileError, match=r"ends in '\.xlsx'; a table is written as \.csv or \.parquet"
    ):
        write_table(TABLE, tmp_path / "run.xlsx")
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_written_leaves_nothing(tmp_path):
    (tmp_path / "run.csv").mkdir()
    with pytest.raises(FileError, match="run.csv cannot be written"):
        write_table(TABLE, tmp_path / "run.csv")
    with pytest.raises(FileError, match="cannot be written: folder .*none does not exist"):
        write_text("text", tmp_path / "none" / "run.toml")
    with pytest.raises(FileError, match="cannot be written"):
        write_text("text", tmp_path / f"{'x' * 300}.toml")
    assert [path.name for path in tmp_path.rglob("*")] == ["run.csv"]


def test_endings():
    assert [ending(name, TABLES) for name in ("a.csv", "a.PARQUET", "a.pq")] == [
        ".csv",
        ".parquet",
        ".pq",
    ]
    assert ending("a.b.SVG", FIGURE) == ".svg"
    with pytest.raises(FileError, match=r"a figure is written as \.png, \.svg or \.pdf"):
        ending("a.csv", FIGURE)


def test_a_folder_that_may_not_be_written_to(tmp_path, monkeypatch):
    check_place(tmp_path / "run.csv")
    monkeypatch.setattr("os.access", lambda *_: False)  # whoever runs this may be allowed all
    with pytest.raises(FileError, match="folder .* may not be written to"):
        check_place(tmp_path / "run.csv")
