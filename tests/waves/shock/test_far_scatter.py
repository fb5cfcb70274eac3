"""Laws for still air end, and scatter grows, where recordings leave them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.registry import LAWS, call, law_for, total_scatter
from jblast.scene import Charge, Scene, Sensor
from jblast.scene.charge import Burst
from jblast.sensors import planned_layout, record
from jblast.sensors.calculator import scene_path, with_rows
from jblast.sensors.simulated_readings import loadings
from jblast.waves.shock import FAR_END, FarScatter, measured_far_scatter

PEAK = "peak_overpressure_pa"
FAR_QUANTITIES = (PEAK, "positive_impulse_pa_s", "positive_duration_s")


def path(z, burst: Burst = "surface"):
    scene = Scene(Charge(mass_kg=1.0, burst=burst))
    return with_rows(scene_path(scene), jnp.asarray(z, float), jnp.ones(len(z)))


@pytest.mark.parametrize("burst", ["surface", "free-air"])
def test_no_law_for_still_air_claims_peak_impulse_or_duration_past_300(burst):
    """Only `ford_2021`, fitted to recordings out to Z = 900, goes farther."""
    for (quantity, name), law in LAWS.items():
        if quantity in FAR_QUANTITIES and name != "ford_2021":
            held = jnp.broadcast_to(call(law.valid, path([301.0, 1e3], burst)), (2,))
            assert not held.any(), (quantity, name)


def test_laws_that_reach_the_far_field_have_its_scatter():
    for (quantity, name), law in LAWS.items():
        if quantity in FAR_QUANTITIES and name not in ("ford_2021", "swisdak"):
            reaches = any(
                bool(jnp.ravel(call(law.valid, path([250.0], burst)))[0])
                for burst in ("surface", "free-air")
            )
            assert reaches == (law.far_scatter is not None), (quantity, name)


def test_it_is_nothing_near_the_charge_and_as_recorded_far_away():
    law = law_for(PEAK, "shock_kinematics")
    sd = np.asarray(total_scatter(law, path([10.0, 100.0, 500.0, 1e9])))
    near = np.hypot(0.1, 0.1)
    # 1/(1 + 3.18^4) = 1 % of the far scatter at Z = 100
    np.testing.assert_allclose(sd[:2], near, rtol=0.01)
    # recorded: medians of 0.5 and 16 to 84 % from 0.26 to 0.89 at Z = 450 to 1000
    assert 0.7 < sd[2] < 1.0
    assert sd[3] == pytest.approx(np.hypot(near, np.hypot(0.854, 0.476)), rel=1e-3)


def test_it_is_differentiable_from_the_charge_to_far_away():
    far = FarScatter(0.8, 0.4, 300.0)
    slope = jax.jit(jax.vmap(jax.grad(lambda z: far.at(z)[0])))
    z = jnp.array([0.0, 1e-3, 300.0, 1e12])
    # F n/(4 Zk) at the knee
    np.testing.assert_allclose(slope(z), [0.0, 0.0, 0.8 / 300.0, 0.0], atol=1e-12)


def test_far_rows_of_a_shot_share_an_effect_of_their_own():
    """The level of near rows neither fixes nor moves that of far ones."""
    sensors = tuple(
        Sensor(f"m{i}", jnp.array([r, 0.0, 0.0]), records=((PEAK, 0.02),))
        for i, r in enumerate((50.0, 280.0, 290.0))
    )
    scene = Scene(Charge(mass_kg=1.0), sensors=sensors)
    layout, _, _ = planned_layout(scene)
    recording = record(scene, layout, {PEAK: "shock_kinematics"})
    effects = np.asarray(loadings(recording, layout))
    assert effects.shape == (3, 2)
    np.testing.assert_allclose(effects[:, 0], 0.1)
    shared, own = measured_far_scatter(PEAK)(np.array([50.0, 280.0, 290.0]), 1.0)
    np.testing.assert_allclose(effects[:, 1], shared, rtol=1e-3)
    np.testing.assert_allclose(recording.record_sd, np.hypot(0.1, own), rtol=1e-3)


def test_the_end_is_where_recorded_peaks_leave_the_law():
    from calibration.far_pressure import every_record

    found = every_record()
    ratio = np.exp(found.log_ratio(PEAK))
    shallow = found.height > -0.2
    past = shallow & (found.z > FAR_END)
    before = shallow & (found.z > 200.0) & (found.z <= FAR_END)
    assert past.sum() == 49
    assert np.median(ratio[past]) == pytest.approx(0.47, abs=0.01)
    assert np.median(ratio[before]) == pytest.approx(0.94, abs=0.01)
