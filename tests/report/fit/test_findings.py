"""Every finding has words, and numbers that JSON can hold."""

import json
from dataclasses import fields
from typing import Any, get_type_hints

import pytest

from jblast.inference import mcmc
from jblast.inference.fitting import (
    assumptions,
    findings as fitting,
    solution,
)
from jblast.inference.posterior.parameters import Estimate, Finding
from jblast.report.fit.findings import words
from jblast.results import plain

MADE: dict[Any, Any] = {
    int: 3,
    float: 0.25,
    str: "wu_hao",
    bool: True,
}
ACCUSED = (fitting.WrongSensor, fitting.WrongClock, fitting.ExchangedSensors)
"""Of these `headline` has the words."""


def kinds():
    """Return every class of findings."""
    for room in (fitting, solution, assumptions, mcmc):
        for kind in vars(room).values():
            is_one = isinstance(kind, type) and issubclass(kind, Finding)
            if is_one and kind not in (Finding, *ACCUSED):
                yield kind


def made(kind: type[Finding]) -> Finding:
    """Make one of a kind."""
    values: dict[str, Any] = {}
    for name, hint in get_type_hints(kind).items():
        if name in {field.name for field in fields(kind)}:
            text = str(hint)
            if hint in MADE:
                values[name] = MADE[hint]
            elif "Estimate" in text:
                told = Estimate(15.0, 1.5, 0.1, 12.6, 15.0, 17.7)
                values[name] = {"charge_mass_kg": told}
            elif "Mapping" in text:
                one = {"charge_mass_kg": 15.0}
                values[name] = (one, one) if "tuple" in text else one
            elif "tuple[tuple" in text:
                values[name] = (("wu_hao", "everywhere"),)
            elif "float" in text:
                values[name] = (0.5, 0.5)
            else:
                values[name] = ("x", "y")
    return kind(**values)


@pytest.mark.parametrize("kind", dict.fromkeys(kinds()))
def test_a_finding_has_words_a_code_and_numbers(kind):
    finding = made(kind)
    said = words(finding)
    assert said
    assert said == said.strip().rstrip(".")
    document = json.loads(json.dumps(plain(finding.to_dict()), allow_nan=False))
    assert document.pop("code") == finding.code
    assert list(document) == [field.name for field in fields(finding)]
