"""`jblast calc`, and the numbers it gives."""

import json

import pytest


@pytest.fixture
def calc(jblast):
    def run(words):
        code, out, err = jblast("calc", *words.split())
        assert (code, err) == (0, "")
        return out

    return run


@pytest.fixture
def numbers(calc):
    return lambda words: json.loads(calc(f"{words} --json"))
