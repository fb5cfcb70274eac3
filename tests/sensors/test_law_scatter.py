"""Scatter of laws and errors that are drawn, and the scatter that `calc` prints."""

import dataclasses
import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import kstest, t

from jblast.registry import law_for
from jblast.scene import Scene, Sensor, with_values
from jblast.sensors import observe, planned_layout
from jblast.sensors.calculator import Question, by_law
from jblast.sensors.simulated_readings import (
    STUDENT_FREEDOM,
    independent_scale,
    student_errors,
    written,
)

PEAK, LAW = "peak_overpressure_pa", "kingery_bulmash"
RANGE_M, MASS_KG, COUNT = 51.0, 12.0, 100_000
GAUGE = Sensor("gauge", jnp.array([0.0, RANGE_M, 0.0]), records=((PEAK, 0.05),))
SCENE = with_values(
    replace(Scene(), sensors=(GAUGE,)), {"charge_mass_kg": MASS_KG, "charge_up_m": 0.0}
)


@pytest.fixture(
    scope="module", params=["student", pytest.param("gaussian", marks=pytest.mark.slow)]
)
def peaks(request):
    """Return peaks of an exact instrument, by noise of instruments."""
    layout, sigma, _ = planned_layout(SCENE)
    exact = jnp.zeros_like(sigma)

    @jax.jit
    @jax.vmap
    def drawn(key):
        return observe(key, SCENE, layout, {PEAK: LAW}, exact, noise=request.param)[0]

    return np.asarray(drawn(jax.random.split(jax.random.key(3), COUNT)))


def test_the_scatter_drawn_is_the_number_that_calc_prints(peaks):
    question = Question(
        scene=replace(SCENE, sensors=()),
        slant_range=(RANGE_M,),
        charge_mass=(MASS_KG,),
    )
    printed = by_law(question.rows(), PEAK)[LAW].scatter[0]
    assert printed == pytest.approx(math.hypot(*law_for(PEAK, LAW).scatter()))
    # four standard errors of the sd of a normal
    assert np.log(peaks).std() == pytest.approx(printed, rel=4 / math.sqrt(2 * COUNT))


def interval_coverage(scale: float) -> float:
    """Return the coverage of 90 % intervals of many unit-normal errors fitted as t.

    The spread of the estimate of a mean is that of an M-estimator (Huber 1964), its
    interval that of the information of the Student-t density.
    """
    x, step = np.linspace(-12.0, 12.0, 100_001, retstep=True)
    weight = np.exp(-(x**2) / 2) / math.sqrt(2 * math.pi) * step
    u, nu = x / scale, STUDENT_FREEDOM
    score = (nu + 1) * u / (nu + u**2) / scale
    slope = (nu + 1) * (nu - u**2) / (nu + u**2) ** 2 / scale**2
    spread = math.sqrt(weight @ score**2) / (weight @ slope)
    claimed = scale * math.sqrt((nu + 3) / (nu + 1))
    return math.erf(1.6449 * claimed / spread / math.sqrt(2))


def test_normal_errors_in_a_student_fit_have_the_stated_coverage():
    scale = float(independent_scale(0.6, 0.8))  # of a unit normal
    assert interval_coverage(scale) == pytest.approx(0.94, abs=5e-3)
    assert interval_coverage(scale / math.sqrt(2)) == pytest.approx(0.80, abs=5e-3)


def test_they_have_students_distribution():
    # by Kolmogorov's statistic; two degrees of freedom more are told apart
    for freedom in (3.0, 4.0):
        drawn = np.asarray(student_errors(jax.random.key(1), freedom, 60_000))
        assert kstest(drawn, t(freedom).cdf).pvalue > 1e-3
        assert kstest(drawn, t(freedom + 2.0).cdf).pvalue < 1e-3


SD = 0.05
SOUTH = dataclasses.replace(
    Scene(),
    scatter=False,
    sensors=(
        Sensor(
            "south",
            jnp.array([0.0, -40.0, 0.0]),
            records=(
                ("bearing_rad", SD),
                ("peak_overpressure_pa", 0.1),
                ("air_arrival_s", 1e-3),
            ),
        ),
    ),
)
LAWS = {
    "bearing_rad": "line_of_sight",
    "peak_overpressure_pa": "kingery_bulmash",
    "air_arrival_s": "kingery_bulmash",
}


def test_a_bearing_about_north_is_read_on_both_sides_of_it_within_a_circle():
    layout, sigma, _ = planned_layout(SOUTH)
    keys = jax.random.split(jax.random.key(0), 400)

    @jax.jit
    @jax.vmap
    def drawn(key):
        return observe(key, SOUTH, layout, LAWS, sigma, noise="gaussian")

    bearing = np.asarray(drawn(keys))[:, layout.quantity.index("bearing_rad")]
    assert ((bearing >= 0) & (bearing < 2 * np.pi)).all()
    off = (bearing + np.pi) % (2 * np.pi) - np.pi
    # 400 draws know the mean to SD/20 and the sd to SD/28: four of each
    assert abs(off.mean()) < 4 * SD / 20
    assert abs(off.std() - SD) < 4 * SD / 28


def test_a_written_log_has_errors_in_the_units_of_its_values():
    layout, sigma, sensors = planned_layout(SOUTH)
    value = np.array([6.2, 2e4, 0.1])
    log = written(SOUTH, layout, value, np.asarray(sigma), sensors)
    # an angle and a time as planned; a pressure's tenth in pascals
    np.testing.assert_allclose(log.sigma, [SD, 2e3, 1e-3], rtol=1e-12)
    assert log.sensor == ("south",) * 3
