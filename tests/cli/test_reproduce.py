import pytest

from swashplate.reproduction import build


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build, "ALL", ("figure 4.4", "figure 9.1", "table 8.1"))


@pytest.mark.usefixtures("few")
def test_page_and_print_are_written(done, tmp_path):
    printed = done("reproduce", "--out", "sub/thesis", "--seed", "3")
    folder = tmp_path / "sub/thesis"
    assert sorted(each.name for each in folder.iterdir()) == [
        "reproduction.html",
        "reproduction.pdf",
    ]
    assert "2 figures and 1 tables" not in printed
    assert "2 figures and 1 table," in printed
    page = (folder / "reproduction.html").read_text("utf-8")
    assert "seed 3" in page
    assert "figure-9-1" in page
    assert (folder / "reproduction.pdf").read_bytes().startswith(b"%PDF")
    for name in ("reproduction.html", "reproduction.pdf"):
        assert f"sub/thesis/{name}" in printed


def test_a_folder_that_cannot_be_made(refused, tmp_path):
    (tmp_path / "file").write_text("")
    assert "file cannot be made: File exists" in refused("reproduce", "--out", "file")
    assert "cannot be made: Not a directory" in refused("reproduce", "--out", "file/below")


def test_a_seed_below_zero_is_refused(run):
    result = run("reproduce", "--seed", "-1")
    assert result.exit_code == 2


@pytest.mark.usefixtures("few")
def test_a_place_that_is_taken(run, tmp_path):
    (tmp_path / "out/reproduction.html").mkdir(parents=True)
    result = run("reproduce", "--out", "out")
    assert result.exit_code == 2
    assert "out/reproduction.html cannot be written: it is a folder" in result.stderr
    assert [each.name for each in (tmp_path / "out").iterdir()] == ["reproduction.html"]
