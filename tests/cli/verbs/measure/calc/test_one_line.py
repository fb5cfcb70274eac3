"""`jblast calc` asked one question: one line, and the other laws below a line."""

import re

import numpy as np
import pytest

from jblast.waves import kingery_bulmash_pressure

FOOT, POUND, PSI = 0.3048, 0.45359237, 6894.757293168361
"""Of the international foot and pound, by definition; psi follows with g = 9.80665."""


def parts(text):
    """Return the line, and what stands below the rule by law."""
    first, rule, *rest = text.splitlines()
    assert set(rule) == {"-"}
    below = rest[: rest.index("")]
    return first, [line for line in below if not line.startswith(" " * 9)]


def test_a_pressure_is_answered_with_the_range_law_validity_and_scatter(calc):
    first, below = parts(calc("--mass 15 --overpressure 5000"))
    told = re.fullmatch(
        r"5 kPa: (\S+) m, kingery_bulmash \(valid here, scatter (\S+) %\)", first
    )
    assert told
    at = float(told[1])
    assert float(kingery_bulmash_pressure(at, 15.0)) == pytest.approx(5e3, rel=1e-3)
    # 10 % a shot and 10 % a record, declared, over the slope of ln p against ln R
    ends = kingery_bulmash_pressure(np.array([0.99, 1.01]) * at, np.full(2, 15.0))
    slope = np.diff(np.log(ends))[0] / np.log(1.01 / 0.99)
    expected = 100.0 * np.hypot(0.1, 0.1) / abs(slope)
    assert float(told[2]) == pytest.approx(expected, rel=0.05)  # two digits
    laws = [line.split()[0] for line in below]
    assert "swisdak" in laws
    assert "kingery_bulmash" not in laws


def test_a_quantity_alone_is_answered_in_one_line(calc):
    first, _ = parts(calc("--mass 15 --range 20 --quantity overpressure"))
    pressure = float(kingery_bulmash_pressure(20.0, 15.0)) / 1e3
    assert first.startswith(f"15 kg of TNT at 20 m: peak overpressure {pressure:.4g} ")


def test_feet_pounds_and_psi_go_in_and_come_out(calc):
    text = calc("--mass 33lb --overpressure 1psi --units us")
    assert "ft/lb^(1/3)" in text
    assert "m/kg" not in text
    assert " K," not in text
    (first, _) = parts(text)
    told = re.match(r"1 psi: (\S+) ft, kingery_bulmash", first)
    assert told
    pressure = kingery_bulmash_pressure(float(told[1]) * FOOT, 33.0 * POUND)
    assert float(pressure) == pytest.approx(PSI, rel=2e-3)  # four digits of the range


def test_json_tells_the_answer_too(numbers):
    told = numbers("--range 50 --impulse 100")["recommended"]
    assert told["quantity"] == "charge_mass_kg"
    by_law = numbers("--range 50 --impulse 100")["quantities"]["charge_mass_kg"]
    assert told["value"] == by_law[told["law"]]["value"]
    assert "recommended" not in numbers("--mass 15 --range 20")


def test_the_line_holds_every_solution_of_its_law(calc, numbers):
    found = numbers("--range 5 --duration 3ms")
    roots = found["quantities"]["charge_mass_kg"]["kingery_bulmash"]["roots"]
    inside = [root["value"] for root in roots if root["valid"]]
    assert len(inside) == 3  # the duration falls and rises again with the mass
    assert inside == pytest.approx([0.34, 686.0, 2248.0], rel=0.01)
    assert found["recommended"]["solutions"] == inside
    first, _ = parts(calc("--range 5 --duration 3ms"))
    assert first.startswith("3 ms: 3 solutions, 0.34")
    for value in ("686", "2248"):
        assert value in first
    assert first.endswith("kg, kingery_bulmash (valid at each)")
