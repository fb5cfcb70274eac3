"""`jblast calc` backwards: the ranges and masses that give a value."""

import pytest

from jblast.waves import kingery_bulmash_pressure, wu_hao_air_arrival_time


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "used"),
    [
        ("--mass 1 --height 1", "surface"),
        ("--mass 1 --height 12 --burst surface", "surface"),
        ("--mass 1 --height 12 --burst free-air", "free-air"),
        ("--range 5 --height 12", "surface"),
    ],
)
def test_where_a_range_or_a_mass_is_asked_for_the_curves_used_are_named(
    words, used, numbers
):
    found = numbers(f"{words} --overpressure 20000")["inputs"]
    (note,) = found["notes"]
    assert found["burst"] == used
    assert note.startswith(f"the {used} curves were used")
    assert "compare with the other --burst" in note


def test_a_pressure_gives_the_range_and_the_mass(numbers):
    found = numbers("--mass 15 --overpressure 20000")["quantities"]
    assert found.keys() == {"range_m"}
    for law in ("kingery_bulmash", "shock_kinematics"):
        entry = found["range_m"][law]
        assert entry.keys() == {"value", "valid", "roots", "range"}
        assert entry["roots"] == [{"value": entry["value"], "valid": True}]
    back = float(
        kingery_bulmash_pressure(found["range_m"]["kingery_bulmash"]["value"], 15.0)
    )
    assert back == pytest.approx(20000.0, rel=1e-9)
    found = numbers("--range 50 --overpressure 20000")["quantities"]
    mass = found["charge_mass_kg"]["kingery_bulmash"]["value"]
    back = float(kingery_bulmash_pressure(50.0, mass))
    assert back == pytest.approx(20000.0, rel=1e-9)


def test_an_inverse_of_an_explosive_gives_its_own_mass(numbers):
    tnt, rdx = (
        numbers(f"--range 50 --impulse 100 --explosive {name}")["quantities"][
            "charge_mass_kg"
        ]["kingery_bulmash"]["value"]
        for name in ("TNT", "RDX")
    )
    assert rdx == pytest.approx(tnt / 1.09, rel=1e-9)


def test_all_roots_and_laws_without_one_are_shown(numbers, calc):
    words = "--mass 15 --duration 0.001"
    found = numbers(words)["quantities"]["range_m"]
    inner, outer = found["kingery_bulmash"]["roots"]
    assert (inner["valid"], outer["valid"]) == (False, True)
    assert found["kingery_bulmash"]["value"] == outer["value"]
    assert found["ford_2021"] == {
        "value": None,
        "valid": False,
        "roots": [],
        "range": found["ford_2021"]["range"],
    }
    text = calc(words)
    assert "none" in text
    assert "outside" in text


def test_an_arrival_is_inverted_by_the_law_that_does_not_scale(numbers):
    value = float(wu_hao_air_arrival_time(20.0, 15.0, 340.0))
    words = f"--range 20 --arrival {value!r} --sound-speed 340"
    found = numbers(words)["quantities"]["charge_mass_kg"]
    assert found["wu_hao"]["value"] == pytest.approx(15.0, rel=1e-9)
    assert found["acoustic"]["value"] is None


def test_roots_as_csv(calc):
    text = calc("--mass 15 --overpressure 20000 --csv")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    assert lines[0] == "range_m,law,valid"
    value, law, valid = next(line for line in lines if "kingery" in line).split(",")
    assert (law, valid) == ("kingery_bulmash", "true")
    assert float(kingery_bulmash_pressure(float(value), 15.0)) == pytest.approx(2e4)


def test_the_attainable_span_can_be_asked_for(jblast, numbers):
    error = jblast.refused("calc", "--mass", "15", "--overpressure", "1e12")
    top = float(error.split(" to ")[1].split(" MPa")[0]) * 1e6
    found = numbers(f"--mass 15 --overpressure {0.99 * top!r}")["quantities"]["range_m"]
    assert any(entry["valid"] for entry in found.values())
