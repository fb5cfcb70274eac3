import csv
import json
from pathlib import Path

import numpy as np
import pytest

import jblast
from calibration.ground_motion import (
    COEFFICIENTS,
    QUANTITIES,
    log_value,
    records as recordings,
)
from jblast.registry import law_for
from jblast.waves import ground_motion_displacement, ground_motion_velocity

PACKAGED = json.loads(
    (Path(jblast.__path__[0]) / "waves/data/ground_motion.json").read_text("utf-8")
)
DATA = Path(jblast.__path__[0]).parent / "calibration/data/seismic_ford2021.csv"
RECORDED = {
    "ground_displacement_m": "p_wave_displacement",
    "ground_peak_velocity_m_s": "p_wave_max_velocity",
}


LINES = [line for line in DATA.read_text("utf-8").splitlines() if line[0] != "#"]
ROWS = [row for row in csv.DictReader(LINES) if not row["path"].startswith("FSS")]
SHOT = np.array([row["source"] for row in ROWS])
SITE = np.array([row["path"].split("-")[0] for row in ROWS])


def recorded(quantity):
    """Return the law, the place of each row, and how far off its ln is."""
    names = ("range_m", "yield_kg", "hob_m", RECORDED[quantity])
    *place, value = np.array([[float(row[name]) for name in names] for row in ROWS]).T
    law = law_for(quantity, "ground_motion")
    return law, place, np.log(value) - np.log(np.asarray(law.function(*place)))


@pytest.mark.parametrize("quantity", RECORDED)
def test_recordings_scatter_about_the_law_as_far_as_it_says(quantity):
    law, place, off = recorded(quantity)
    parts = law.scatter(*place)
    claimed = np.sqrt(sum(np.square(sd) for sd in map(np.asarray, parts)))
    assert np.all(np.asarray(law.valid(*place)))
    # three sites of four, the mean of each within two of their scatter
    means = [np.mean(off[name == SITE]) for name in np.unique(SITE)]
    assert np.max(np.abs(means)) < 2 * claimed.mean()
    # about the mean of each shot: paths and records
    _, path, own = (float(np.mean(sd)) for sd in parts)
    _, index = np.unique(SHOT, return_inverse=True)
    left = off - (np.bincount(index, off) / np.bincount(index))[index]
    assert 0.8 < left.std() / np.hypot(path, own) < 1.4


def test_a_buried_charge_moves_the_ground_three_times_as_far():
    for law in (ground_motion_displacement, ground_motion_velocity):
        above, buried = (float(law(1e3, 500.0, h)) for h in (8.0, -8.0))
        assert 2.5 < buried / above < 4.5  # e^1.2 +- 0.14
        assert float(law(2e3, 500.0, 8.0)) < above


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_coefficients_are_those_of_least_squares_with_the_scatter_they_came_with(
    quantity,
):
    records, curve = recordings(), PACKAGED["curves"][quantity]
    b = dict(zip(COEFFICIENTS, curve["coefficients"], strict=True))
    mass = np.cbrt(records.charge_mass)
    height = records.height_of_burst / mass
    coupled = 1 / (1 + np.exp(b["b4"] * (height - b["b5"])))
    log_range = np.log(records.slant_range / mass)
    design = np.stack([np.ones(len(mass)), log_range, coupled], axis=1)
    covariance = curve["record_sd"] ** 2 * np.eye(len(mass))
    for names, sd in (
        (records.site, curve["site_sd"]),
        (records.shot, curve["shot_sd"]),
        (records.path, curve["path_sd"]),
    ):
        covariance += sd**2 * (names[:, None] == names[None, :])
    weighted = np.linalg.solve(covariance, design)
    value = log_value(quantity, records)
    found = np.linalg.solve(design.T @ weighted, weighted.T @ value)
    # what is packaged is rounded to six digits, and b5 with it
    np.testing.assert_allclose(found, curve["coefficients"][:3], rtol=1e-4, atol=1e-4)
    # slopes by b5 vanish there: it is the most probable one, not one of the likes
    slope = b["b3"] * b["b4"] * coupled * (1 - coupled)
    left = np.linalg.solve(covariance, value - design @ found)
    assert abs(slope @ left) < 1e-3 * np.sqrt(
        slope @ np.linalg.solve(covariance, slope)
    )
