"""The calculator's answer for other programs: JSON and CSV."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from jblast.json_values import plain
from jblast.report.calculator.header import header, title
from jblast.report.calculator.inputs import inputs
from jblast.report.calculator.notes import disagreement_words, notes
from jblast.report.tables import comma_separated
from jblast.sensors.calculator.disagreement import Disagreement
from jblast.sensors.calculator.forward import Calculated, Calculation
from jblast.sensors.calculator.inverse import Roots
from jblast.sensors.calculator.question import Question
from jblast.sensors.calculator.recommended import Recommended


def calculation_json(
    question: Question,
    answer: Calculation,
    other: Calculation | None = None,
    apart: Sequence[Disagreement] = (),
    told: Recommended | None = None,
) -> str:
    """Return inputs and quantities; lists by row where there are several rows.

    Args:
        question: What was asked.
        answer: What the laws say.
        other: What those of two curve sets say by the other set, if that is of use.
        apart: Where laws that hold disagree.
        told: The answer, where one question was asked.
    """
    quantities: dict[str, dict[str, Any]] = {}
    for quantity, by_law in answer.items():
        quantities[quantity] = {}
        for name, of_law in by_law.items():
            entry = {**_value(of_law), "range": of_law.range}
            if other is not None and of_law.two_sets:
                entry["other_burst"] = _value(other[quantity][name])
            quantities[quantity][name] = entry
    whole = {"inputs": inputs(question), "quantities": quantities}
    answered = {"recommended": asdict(told)} if told else {}
    return _json(whole | answered | {"disagreements": [asdict(one) for one in apart]})


def roots_json(question: Question, answer: dict[str, Roots], told: Recommended) -> str:
    """Return inputs, the answer, and by law the best root and all of them."""
    by_law = {}
    for name, found in answer.items():
        value, valid = found.best() or (None, False)
        pairs = zip(found.value, found.valid, strict=True)
        by_law[name] = {
            "value": value,
            "valid": valid,
            "roots": [{"value": float(v), "valid": bool(ok)} for v, ok in pairs],
            "range": found.law.range,
        }
    asked = inputs(question)
    quantities = {asked["asked"]: by_law}
    return _json(
        {"inputs": asked, "recommended": asdict(told), "quantities": quantities}
    )


def calculation_csv(
    question: Question, answer: Calculation, apart: Sequence[Disagreement] = ()
) -> str:
    """Return one value a line; the inputs stand above as comments."""
    ranges, masses = question.rows()
    lines = [("range_m", "mass_kg", "quantity", "law", "value", "valid")]
    for quantity, by_law in answer.items():
        for name, of_law in by_law.items():
            for i, (r, m) in enumerate(zip(ranges, masses, strict=True)):
                value, valid = repr(float(of_law.value[i])), bool(of_law.valid[i])
                row = (repr(float(r)), repr(float(m)), quantity, name, value)
                lines.append((*row, str(valid).lower()))
    said = "".join(
        f"# {one.quantity}: {disagreement_words(one, question)}\n" for one in apart
    )
    return _comments(question) + said + comma_separated(lines)


def roots_csv(question: Question, answer: dict[str, Roots]) -> str:
    """Return one root a line; the inputs stand above as comments."""
    lines = [(inputs(question)["asked"], "law", "valid")]
    for name, found in answer.items():
        for value, valid in zip(found.value, found.valid, strict=True):
            lines.append((repr(float(value)), name, str(bool(valid)).lower()))
    return _comments(question) + comma_separated(lines)


def _value(of_law: Calculated) -> dict[str, Any]:
    value, valid = np.asarray(of_law.value), np.asarray(of_law.valid)
    if len(value) == 1:
        return {"value": float(value[0]), "valid": bool(valid[0])}
    return {"value": value.tolist(), "valid": valid.tolist()}


def _comments(question: Question) -> str:
    said = [title(question), *(f"{name}: {text}" for name, text in header(question))]
    said += notes(question, beside=False)
    return "".join(f"# {line}\n" for line in said)


def _json(answer: dict[str, Any]) -> str:
    text = json.dumps(plain(answer), indent=1, allow_nan=False, ensure_ascii=False)
    return text + "\n"
