from functools import cache
from importlib.resources import files
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.constants import STANDARD_PRESSURE
from jblast.waves.laws import negative_phase_ufc as ufc
from tests.tools.slopes import with_slopes
from tests.waves.laws.kingery_bulmash.curves import TRANSCRIBED_AGAIN, rows

LAWS = {
    "Pr_neg_kPa": ufc.ufc_reflected_negative_pressure,
    "Pso_neg_kPa": ufc.ufc_negative_pressure,
    "ir_neg_kPa_ms_kg13": ufc.ufc_reflected_negative_impulse,
    "is_neg_kPa_ms_kg13": ufc.ufc_negative_impulse,
    "t_neg_ms_kg13": ufc.ufc_negative_duration,
}
UNITS = {"Pr": 1e3, "Pso": 1e3, "ir": 1.0, "is": 1.0, "t": 1e-3}
every_law = pytest.mark.parametrize("column", LAWS)


@cache
def log_law(column):
    """Give ln y of ln Z, at 1 kg in standard air, its slope and its curvature."""
    return with_slopes(lambda log_z: jnp.log(LAWS[column](jnp.exp(log_z), 1.0)))


TABLE = rows(Path(str(files("jblast.waves") / "data/negative_phase_ufc.csv")))
Z = np.array([float(row["Z_m_kg13"]) for row in TABLE])


def printed(column):
    unit = UNITS[column.partition("_")[0]]
    return unit * np.array([float(row[column]) for row in TABLE])


@every_law
def test_every_reading_is_met_unless_it_nears_the_ambient_pressure(column):
    readings = printed(column)
    met = np.ones(Z.size, bool)
    if column.endswith("kPa"):
        met = readings < STANDARD_PRESSURE / 1.05
        assert met.sum() > 20
    # rounding of ln y and of the cube root
    np.testing.assert_allclose(
        LAWS[column](Z[met], 1.0), readings[met], rtol=1e-13, atol=0
    )


@pytest.mark.parametrize("column", ["Pr_neg_kPa", "Pso_neg_kPa"])
def test_no_suction_exceeds_the_ambient_pressure_at_any_distance(column):
    z = jnp.geomspace(1e-4, 1e5, 20001)
    for ambient in (STANDARD_PRESSURE, 4e4):
        assert LAWS[column](z, 1.0, ambient).max() < ambient
    # and readings are moved by less than their own excess and a hundredth
    readings = printed(column)
    lower = np.minimum(readings, STANDARD_PRESSURE)
    moved = np.asarray(LAWS[column](Z, 1.0)) / lower - 1
    assert moved.max() < 1e-12
    assert moved.min() > -0.01


@pytest.mark.parametrize(
    ("z", "kilopascal"), [(1.0, 84.0), (2.0, 25.0), (5.0, 8.1), (10.0, 3.7)]
)
def test_incident_pressures_are_the_quoted_ones(z, kilopascal):
    # formulas.md 4: two digits, the last from rows beside these Z
    np.testing.assert_allclose(
        ufc.ufc_negative_pressure(z, 1.0), 1e3 * kilopascal, rtol=0.015
    )


def test_a_cubic_has_the_tabulated_impulse_where_the_head_of_the_table_says():
    pressure, impulse, duration = (
        printed(c) for c in ("Pso_neg_kPa", "is_neg_kPa_ms_kg13", "t_neg_ms_kg13")
    )
    reflected = printed("Pr_neg_kPa") / printed("ir_neg_kPa_ms_kg13")
    away = (Z < 0.3) | (Z > 2.5)
    between = (Z > 0.9) & (Z < 1.2)
    for ratio in (pressure / impulse, reflected):
        cubic = 9 / 16 * ratio * duration
        assert cubic[away].min() > 0.955
        assert cubic[away].max() < 1.175
        assert cubic[between].min() > 1.5
    assert (9 / 16 * pressure / impulse * duration).max() < 1.855


@every_law
def test_past_the_table_it_is_a_power_law_with_the_end_slope(column):
    _, slopes, _ = log_law(column)(np.log([1e-3, 1e6, 0.05, 36.975]))
    np.testing.assert_allclose(slopes[:2], slopes[2:], rtol=1e-10)


def test_it_holds_in_free_air_only_and_within_its_table():
    z = np.array([0.049, 0.051, 36.9, 37.0])
    assert ufc.ufc_valid(z, 1.0).tolist() == [False, True, True, False]
    assert not ufc.ufc_valid(z, 1.0, burst="surface").any()
    assert (Z[0], Z[-1]) == (ufc.FIRST, ufc.LAST)


def test_the_packaged_table_is_the_other_transcription():
    assert rows(TRANSCRIBED_AGAIN / "negative_phase_ufc_free_air.csv") == TABLE
