"""Thresholds of pressure are named as thresholds, with their published values."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Scene, Sensor, UncertainScene
from jblast.study.outcome.family import Setting
from jblast.study.outcome.quantities import LIMITS, prepare

LAW = ("peak_overpressure_pa", "kingery_bulmash")
KPA = {
    # Clancey 1972, printed in kPa: "typical pressure for glass breakage"
    "above_glass_threshold": 1.03,
    # Zipf and Cashdollar 2007 print 5 and 15 psi; 1 psi is 6.8948 kPa
    "above_eardrum_threshold": 5 * 6.8948,
    "above_lung_threshold": 15 * 6.8948,
}


@pytest.mark.parametrize("name", KPA)
def test_a_threshold_has_its_published_value(name):
    assert LIMITS[name].value == pytest.approx(1e3 * KPA[name], rel=5e-3)


def test_a_sample_is_above_a_threshold_where_its_peak_is():
    gauge = Sensor("gauge", (40.0, 0.0, 1.5))
    scene = UncertainScene(Scene(sensors=(gauge,), law=(LAW,)))
    names = ("peak_overpressure_pa", "above_threshold", "above_glass_threshold")
    setting = Setting(scene, scene, names, {"threshold_pa": 9e3}, {})
    # without and with scatter the peak is about 3, 9 and 60 kPa
    masses = {"charge_mass_kg": jnp.array([1.0, 15.0, 1000.0])}
    keys = jax.random.split(jax.random.key(0), 3)
    found = jax.jit(prepare(setting).batched)(keys, masses)
    peak = np.asarray(found["peak_overpressure_pa"])
    for name, limit in (("above_threshold", 9e3), ("above_glass_threshold", 1034.2)):
        np.testing.assert_array_equal(np.asarray(found[name]) == 1, peak > limit)
    assert 0 < np.mean(peak > 9e3) < 1
