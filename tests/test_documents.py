"""What is wrong in a TOML document, said in one sentence."""

import pytest
from pydantic import BaseModel, ConfigDict

from swashplate import ParameterError
from swashplate.documents import validated


class Entry(BaseModel):
    model_config = ConfigDict(extra="forbid")
    column: str
    unit: str


class Document(BaseModel):
    model_config = ConfigDict(extra="forbid")
    signal: Entry


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ({"colunm": "u", "unit": "V"}, "needs an entry 'column'; it has 'colunm', which may be"),
        ({"rate": 1, "unit": "V"}, "[signal] needs an entry 'column'."),
        ({"column": "u", "unit": "V", "unti": "V"}, "no entry 'unti': perhaps 'unit' is meant"),
    ],
)
def test_one_sentence(entries, said):
    with pytest.raises(ParameterError) as refused:
        validated({"signal": entries}, Document, "a.toml")
    assert said in str(refused.value)
    assert str(refused.value).startswith("a.toml: [signal]")
