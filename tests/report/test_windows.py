import numpy as np
import pytest
from swashplate.report.windows import rows_within

from swashplate import InputError

TIME = np.array([0.0, 1.0, 2.0, 3.0, 4.0])


def test_a_window_holds_its_ends() -> None:
    assert rows_within(TIME, (1.0, 3.0), "x") == slice(1, 4)
    assert rows_within(TIME, (0.5, 9.0), "x") == slice(1, 5)
    assert rows_within(TIME, None, "x") == slice(0, 5)


@pytest.mark.parametrize("window", [(1.5, 2.5), (8.0, 9.0), (3.0, 1.0)])
def test_a_window_without_a_line_is_refused(window: tuple[float, float]) -> None:
    with pytest.raises(InputError, match=r"samples of boom.csv, which goes from 0 s to 4 s"):
        rows_within(TIME, window, "boom.csv")
