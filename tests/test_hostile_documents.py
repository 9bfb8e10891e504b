"""Documents as nobody should write them: taken, or refused in one sentence, and soon."""

import os

import numpy as np
import pytest
from tests.fuzz import documents


@pytest.mark.slow
@pytest.mark.parametrize("kind", documents.READERS)
def test_a_sentence_or_a_value(kind, tmp_path, monkeypatch):
    """`make fuzz` goes on for minutes with other seeds."""
    monkeypatch.setitem(os.environ, "TOKEN_OF_THE_TEST", "secret")
    random = np.random.default_rng(1)
    text = documents.valid(kind, tmp_path)
    documents.read_document(kind, tmp_path, text, random)
    for _ in range(300):
        documents.read_document(kind, tmp_path, documents.spoiled(text, random), random)
