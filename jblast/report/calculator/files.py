"""The calculator's answer for other programs: JSON and CSV."""

import json
from collections.abc import Sequence
from typing import Any

from jblast.report.calculator.answer import calculator_answer, inverse_answer
from jblast.report.calculator.header import header, title
from jblast.report.calculator.inputs import inputs
from jblast.report.calculator.notes import disagreement_words, notes
from jblast.report.tables import comma_separated
from jblast.sensors.calculator.disagreement import Disagreement
from jblast.sensors.calculator.forward import Calculation
from jblast.sensors.calculator.inverse import Roots
from jblast.sensors.calculator.question import Question
from jblast.sensors.calculator.recommended import Recommended


def calculation_json(
    question: Question,
    answer: Calculation,
    other: Calculation | None = None,
    apart: Sequence[Disagreement] = (),
    recommended: Recommended | None = None,
) -> str:
    """Return inputs and quantities as JSON; arguments as of `calculator_answer`."""
    return _json(
        calculator_answer(question, answer, other, apart, recommended).to_dict()
    )


def roots_json(
    question: Question, answer: dict[str, Roots], recommended: Recommended
) -> str:
    """Return inputs, the answer, and by law the best root and all of them as JSON."""
    return _json(inverse_answer(question, answer, recommended).to_dict())


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
    lines = [(str(inputs(question).asked), "law", "valid")]
    for name, found in answer.items():
        for value, valid in zip(found.value, found.valid, strict=True):
            lines.append((repr(float(value)), name, str(bool(valid)).lower()))
    return _comments(question) + comma_separated(lines)


def _comments(question: Question) -> str:
    said = [title(question), *(f"{name}: {text}" for name, text in header(question))]
    said += notes(question, beside=False)
    return "".join(f"# {line}\n" for line in said)


def _json(answer: dict[str, Any]) -> str:
    text = json.dumps(answer, indent=1, allow_nan=False, ensure_ascii=False)
    return text + "\n"
