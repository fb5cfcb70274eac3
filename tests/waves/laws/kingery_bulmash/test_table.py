"""The curves of Kingery and Bulmash are those that were printed."""

import math
from importlib.resources import files
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.waves.curves import BLEND_WIDTH, smooth_step
from jblast.waves.laws import kingery_bulmash as kb
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_curve
from tests.waves.laws.kingery_bulmash.curves import LAWS, TRANSCRIBED_AGAIN, rows


def printed(row, z):
    """Evaluate a row as printed, in its own unit: the reference for everything."""
    coefficients = [float(row[f"C{i}"]) for i in range(int(row["degree"]) + 1)]
    u = float(row["K0"]) + float(row["K1"]) * np.log10(z)
    return 10 ** np.polynomial.polynomial.polyval(u, coefficients)


TABLE = [
    row
    for row in rows(Path(str(files("jblast.waves") / "data/kingery_bulmash.csv")))
    if row["variant"] == "brl1984"
]


@pytest.mark.parametrize(
    "row", TABLE, ids=lambda r: f"{r['burst']}-{r['quantity']}-{r['segment']}"
)
def test_the_printed_polynomials_hold_outside_the_blends(row):
    burst = {"hemispherical": "surface", "spherical": "free-air"}[row["burst"]]
    curve = kingery_bulmash_curve(row["quantity"], burst)
    first, last = float(row["z_min"]), float(row["z_max"])
    half = math.sqrt(1 + BLEND_WIDTH) * (1 + 1e-12)
    z = np.geomspace(
        first * (half if first > curve.z_min else 1),
        last / (half if last < curve.z_max else 1),
        200,
    )
    values = LAWS[row["quantity"]](jnp.asarray(z), 1.0, burst=burst)
    unit = {"kPa": 1e3, "ms/kg^(1/3)": 1e-3, "m/ms": 1e3}.get(row["y_unit"], 1.0)
    # Twelve Horner steps with terms up to ten times the sum, exponents up to 18:
    # a hundred roundings of 1e-16.
    np.testing.assert_allclose(values, printed(row, z) * unit, rtol=1e-13)


def test_impulse_at_a_kilogram_and_a_metre_is_the_236_43_of_the_1984_digits():
    # reference README D4; with the other lineage of that digit it would be 232.34.
    # Z = 1 lies past the blend, which ends at 0.979. Printed digits.
    assert kb.kingery_bulmash_impulse(1.0, 1.0) == pytest.approx(236.43, abs=0.005)


@pytest.mark.parametrize(
    ("z", "mass_ratio"),
    [
        (0.2, 1.39),
        (0.5, 1.39),
        (1.0, 1.57),
        (2.0, 1.62),
        (5.0, 1.66),
        (10.0, 1.82),
        (20.0, 1.58),
    ],
)
def test_ground_factors_by_arrival_are_the_published_ones(z, mass_ratio):
    # formulas.md 8, likewise; half of the last digit, and a tenth of it for 1.8148
    less, more = (
        float(kb.kingery_bulmash_arrival_time(z, mass_ratio + h, burst="free-air"))
        for h in (5.5e-3, -5.5e-3)
    )
    assert less < float(kb.kingery_bulmash_arrival_time(z, 1.0)) < more


def test_the_packaged_table_is_the_metric_part_of_the_other_transcription():
    reference = rows(TRANSCRIBED_AGAIN / "kingery_bulmash.csv")
    packaged = rows(Path(str(files("jblast.waves") / "data/kingery_bulmash.csv")))
    assert packaged == [row for row in reference if row["units"] == "metric"]


def test_the_packaged_curves_are_those_printed_in_feet_and_pounds():
    packaged = rows(Path(str(files("jblast.waves") / "data/kingery_bulmash.csv")))
    printed_in_feet = {
        (row["burst"], row["quantity"], row["segment"], row["variant"]): row
        for row in rows(TRANSCRIBED_AGAIN / "kingery_bulmash.csv")
        if row["units"] == "imperial"
    }
    pound = 0.45359237 ** (1 / 3)
    units = {"kPa": 6.894757293, "kPa-ms/kg^(1/3)": 6.894757293 / pound}
    units |= {"ms/kg^(1/3)": 1 / pound, "m/ms": 0.3048}
    compared = 0
    for row in packaged:
        key = row["burst"], row["quantity"], row["segment"], row["variant"]
        if key not in printed_in_feet:
            continue
        z = np.geomspace(float(row["z_min"]), float(row["z_max"]), 50)
        in_feet = printed(printed_in_feet[key], z * pound / 0.3048)
        # their constants have twelve digits and less; 3.9e-6 is what rounding left
        np.testing.assert_allclose(
            printed(row, z), units[row["y_unit"]] * in_feet, rtol=5e-6, err_msg=str(key)
        )
        compared += 1
    assert compared == len(printed_in_feet) == 20


@pytest.mark.parametrize(
    ("quantity", "burst", "join", "largest"),
    [
        ("incident_impulse", "surface", 0.955, 0.3471),
        ("incident_impulse", "free-air", 0.792, 0.3078),
        ("positive_phase_duration", "surface", 1.01, 0.9159),
        ("positive_phase_duration", "surface", 2.78, 0.4392),
        ("positive_phase_duration", "free-air", 0.888, 0.4844),
        ("positive_phase_duration", "free-air", 2.28, 0.0432),
    ],
)
def test_blends_change_the_curves_by_what_the_docstring_says(
    quantity, burst, join, largest
):
    curve = kingery_bulmash_curve(quantity, burst)
    k = [s.z_min for s in curve.segments].index(join)
    log_z = math.log(join) + math.log1p(BLEND_WIDTH) * np.linspace(-0.5, 0.5, 2001)
    plain = np.where(
        log_z < math.log(join),
        curve.segments[k - 1].log_value(log_z),
        curve.segments[k].log_value(log_z),
    )
    change = np.abs(np.expm1(np.asarray(curve.log_value(jnp.asarray(log_z))) - plain))
    # Four printed digits, and a grid of 2001 points that may miss the join by a step.
    assert 100 * change.max() == pytest.approx(largest, abs=2e-3)


def test_a_blend_is_five_percent_wide_and_twice_smooth():
    inner, outer = 1e-9, 0.5 * math.log(1.05)
    first, second = jax.grad(smooth_step), jax.grad(jax.grad(smooth_step))
    for sign, end in ((-1, 0.0), (1, 1.0)):
        edge = math.log(2.0) + sign * (outer - inner)
        assert float(smooth_step(jnp.array(edge), 2.0)) == pytest.approx(end, abs=1e-12)
        assert float(first(edge, 2.0)) == pytest.approx(0.0, abs=1e-6)
        # It rises from zero as 60 t / width^2 = 5e-4 at this t = 2e-8; a step that is
        # smooth only once has 6 / width^2 = 2500 here.
        assert float(second(edge, 2.0)) == pytest.approx(0.0, abs=1e-2)
    assert float(smooth_step(jnp.array(math.log(2.0)), 2.0)) == pytest.approx(0.5)
