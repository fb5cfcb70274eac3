"""Results as documents: entries and schema from one type."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np
import pytest
from jaxtyping import Float
from jsonschema import Draft202012Validator, ValidationError

from jblast.results import (
    ABSENT,
    AMONG,
    HIDDEN,
    Document,
    Words,
    among,
    described,
    entries,
    restored,
    schema_of,
)


class Reading(NamedTuple):
    """A reading.

    Attributes:
        value: Its value [Pa].
        sd: Its standard deviation
            [Pa].
        raw: Counts.
    """

    value: float
    sd: float
    raw: int


class Remark(NamedTuple):
    """A finding that a document has in words."""

    code: int


def remark_words(of: Remark) -> str:
    return f"remark {of.code}"


@dataclass(frozen=True)
class Example(Document):
    """An answer.

    Attributes:
        time_s: When.
        reading: What.
        note: Why, where there is a reason.
        laws: By quantity.
        samples: Of the record.
        remarks: Remarks.
    """

    words: ClassVar[Words] = {Remark: remark_words}
    time_s: float = field(metadata={"key": "start_s"})
    reading: Reading | None = field(metadata=among("value", "sd"))
    note: str | None = field(metadata=ABSENT)
    laws: Mapping[str, str] = field(metadata=AMONG)
    samples: tuple[int, ...] = field(metadata=HIDDEN)
    remarks: tuple[Remark, ...] = ()


FULL = Example(math.inf, Reading(2.0, 0.1, 7), "late", {"x": "law"}, (1,), (Remark(4),))
BARE = Example(1.0, None, None, {}, ())


def test_entries_are_renamed_selected_merged_worded_and_left_out():
    whole = {"start_s": None, "value": 2.0, "sd": 0.1, "note": "late", "x": "law"}
    assert FULL.to_dict() == {"schema": 1} | whole | {"remarks": ["remark 4"]}
    assert BARE.to_dict() == {"schema": 1, "start_s": 1.0, "remarks": []}
    assert json.loads(FULL.to_json()) == FULL.to_dict()
    assert entries(FULL)["remarks"] == [{"code": 4}]


@dataclass(frozen=True)
class Run(Document):
    """A run, without words.

    Attributes:
        time_s: When.
        places: Readings by place, or their number.
        last: The last reading.
        others: Further numbers.
    """

    time_s: float
    places: Mapping[str, Reading | int]
    last: tuple[float, float] | None
    others: Mapping[str, float] = field(metadata=AMONG)


def test_a_result_is_restored_from_its_entries():
    places = {"a": Reading(2.0, 0.1, 7), "b": 3}
    for last in (None, (1.0, 2.0)):
        run = Run(1.5, places, last, {"x": 4.0})
        again = restored(Run, json.loads(run.to_json()))
        assert again == run
    lost = restored(Run, Run(math.nan, {}, None, {}).to_dict())
    assert math.isnan(lost.time_s)


def test_the_schema_takes_these_entries_and_no_others():
    schema = schema_of(Example)
    check = Draft202012Validator(schema)
    check.validate(FULL.to_dict())
    check.validate(BARE.to_dict())
    for wrong in ({"schema": 2}, {"start_s": "now"}, {"note": None}, {"x": 1}):
        with pytest.raises(ValidationError):
            check.validate(FULL.to_dict() | wrong)
    assert schema["properties"]["start_s"]["description"] == "When"
    strict = Draft202012Validator(schema_of(Reading))
    with pytest.raises(ValidationError):
        strict.validate({"value": 1.0, "sd": 0.1, "raw": 1, "more": 1})
    with pytest.raises(ValidationError):
        strict.validate({"value": 1.0, "sd": 0.1})


def test_descriptions_are_those_of_the_docstring():
    assert described(Reading)["sd"] == "Its standard deviation [Pa]"
    assert described(Example)["time_s"] == "When"


def test_arrays_have_the_schema_of_their_shape_and_a_wrong_annotation_is_refused():
    numbers = {"type": ["number", "null"]}
    row = {"type": "array", "items": numbers}
    assert schema_of(Float[np.ndarray, ""]) == numbers
    assert schema_of(Float[np.ndarray, "3"]) == row
    assert schema_of(Float[np.ndarray, "row 3"]) == {"type": "array", "items": row}
    for wrong in (np.ndarray, set[int], list, object):
        with pytest.raises(TypeError, match="expected a type with a form in JSON"):
            schema_of(wrong)
