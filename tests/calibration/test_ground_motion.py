"""The packaged curves of ground motion are those of generalised least squares."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import jblast.waves
from calibration.ground_motion import COEFFICIENTS, QUANTITIES, read_ground

PACKAGED = json.loads(
    (Path(jblast.waves.__path__[0]) / "data" / "ground_motion.json").read_text("utf-8")
)


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_coefficients_are_those_of_least_squares_with_the_scatter_they_came_with(
    quantity,
):
    records, curve = read_ground(), PACKAGED["curves"][quantity]
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
    value = records.log_value[quantity]
    found = np.linalg.solve(design.T @ weighted, weighted.T @ value)
    # what is packaged is rounded to six digits, and b5 with it
    np.testing.assert_allclose(found, curve["coefficients"][:3], rtol=1e-4, atol=1e-4)
    # slopes by b5 vanish there: it is the most probable one, not one of the likes
    slope = b["b3"] * b["b4"] * coupled * (1 - coupled)
    left = np.linalg.solve(covariance, value - design @ found)
    assert abs(slope @ left) < 1e-3 * np.sqrt(
        slope @ np.linalg.solve(covariance, slope)
    )


def test_all_records_are_there_and_their_units_are_said_to_be_inferred():
    records = read_ground()
    assert records.shot.size == PACKAGED["n_records"] == 200
    assert sorted(set(records.shot)) == PACKAGED["shots"]
    assert "units inferred" in PACKAGED["source"]


def test_ground_motion_does_not_make_masses_of_shots_left_out_worse():
    kept = Path(__file__).parents[2] / "calibration/results/ground_motion_joint.txt"
    by_shot, by_campaign = kept.read_text("utf-8").split("Each campaign left out")

    def numbers(text, row):
        line = next(line for line in text.splitlines() if line.startswith(f"  {row}"))
        return [float(x) for x in re.findall(r"[-+]?\d+\.?\d*", line)]

    for table in (by_shot, by_campaign):
        *_, inside_alone, n = numbers(table, "acoustic alone")
        *_, inside, _ = numbers(table, "both")
        assert n == 15
        assert inside >= inside_alone
        # the bootstrap over shots (or campaigns) does not exclude a gain of score
        _, _, high = numbers(table, "gain in mean score")
        assert high > 0
    (error_alone, score_alone, *_), (error, score, *_) = (
        numbers(by_shot, row) for row in ("acoustic alone", "both")
    )
    assert error <= error_alone
    assert score >= score_alone
