"""The calculator's answer as JSON: what its schema says, and nothing else."""

import math
from dataclasses import replace

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from docs.generate import documents
from jblast.registry import LAWS
from jblast.report.calculator.answer import calculator_answer, inverse_answer
from jblast.scene import Charge, Scene
from jblast.sensors.calculator import (
    Calculated,
    Disagreement,
    Question,
    Recommended,
    Roots,
)
from tests.report.made_up import chosen

CHOICE = chosen("air_arrival_s", "kingery_bulmash")
APART = Disagreement("air_arrival_s", "a", "b", 2.0, 1.5, 20.0, 15.0, 1, CHOICE)
TOLD = Recommended("peak_overpressure_pa", "a", 1.0, True, math.nan, CHOICE)


@pytest.mark.parametrize(
    "question",
    [
        Question(Scene(), (20.0,), (15.0,)),
        Question(Scene(Charge(position_m=(0.0, 0.0, 3.0))), (20.0, 40.0), (15.0,)),
    ],
)
def test_the_schema_takes_one_row_and_several(question):
    value = np.arange(1.0, 1.0 + len(question.slant_range))
    one = Calculated(value, value > 1.0, "Z from 1 to 2 m/kg^(1/3)", two_sets=True)
    laws = {"peak_overpressure_pa": {"a": one, "b": replace(one, two_sets=False)}}
    schema = Draft202012Validator(documents.schema("calc"))
    for beside in ((None, (), None), (laws, (APART,), TOLD)):
        answer = calculator_answer(question, laws, *beside).to_dict()
        schema.validate(answer)
        assert not schema.is_valid(answer | {"more": 1})
        assert not Draft202012Validator(documents.schema("calc_inverse")).is_valid(
            answer
        )
    by_law = answer["quantities"]["peak_overpressure_pa"]
    assert "other_burst" in by_law["a"]
    assert "other_burst" not in by_law["b"]
    assert answer["recommended"]["scatter"] is None
    assert answer["recommended"]["reason"].startswith("Z = 2.1 to 38 m/kg^(1/3)")
    assert answer["disagreements"][0]["taken"] == "kingery_bulmash"
    assert list(answer["recommended"]) == [
        *("quantity", "law", "value", "valid", "scatter", "reason")
    ]
    assert list(answer["disagreements"][0]) == [
        *("quantity", "low", "high", "ratio", "expected", "range_m", "mass_kg"),
        *("rows", "taken", "reason"),
    ]


@pytest.mark.parametrize("given", [{"charge_mass": (15.0,)}, {"slant_range": (20.0,)}])
def test_the_schema_takes_a_range_or_a_mass(given):
    question = Question(Scene(), quantity="peak_overpressure_pa", target=1e4, **given)
    law = LAWS["peak_overpressure_pa", "kingery_bulmash"]
    found = Roots(law, np.array([9.0, 30.0]), np.array([False, True]), (1.0, 2.0))
    none = replace(found, value=np.empty(0), valid=np.empty(0, bool), attained=None)
    answer = inverse_answer(question, {"a": found, "b": none}, TOLD).to_dict()
    schema = documents.schema("calc_inverse")
    Draft202012Validator.check_schema(schema)
    Draft202012Validator(schema).validate(answer)
    ((asked, by_law),) = answer["quantities"].items()
    assert asked == answer["inputs"]["asked"]
    assert by_law["a"]["value"] == 30.0
    assert by_law["b"]["value"] is None
    assert answer["inputs"]["peak_overpressure_pa"] == 1e4
    assert ("mass_kg" in answer["inputs"]) is ("charge_mass" in given)
