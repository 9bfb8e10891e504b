"""Log files for the tests of their readers."""

from collections.abc import Callable
from pathlib import Path

import pytest

from swashplate.logs import Log, TextOptions, open_log


@pytest.fixture
def text(tmp_path: Path) -> Callable[..., Log]:
    """Write a text file, by default as UTF-8, and open it."""

    def write(
        content: str | bytes, name: str = "log.csv", encoding: str = "utf-8", **options: object
    ) -> Log:
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode(encoding))
        return open_log(path, options=TextOptions(**options))

    return write


@pytest.fixture
def all_of() -> Callable[[Log], dict[str, list[float]]]:
    """All columns of a log as lists."""

    def read(log: Log) -> dict[str, list[float]]:
        names = [column.name for column in log.columns]
        return {name: array.tolist() for name, array in log.read(names).items()}

    return read
