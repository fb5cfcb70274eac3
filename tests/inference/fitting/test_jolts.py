"""What a jolt tells of its charge: alone a curve; with flash and arrival, its size."""

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference import fit
from jblast.observations import observed
from jblast.scene import Charge, Free, Scene, UncertainScene, VehicleSpec

PLACE = jnp.array([25.0, 0.0, 4.0])
SCENE = Scene(Charge(10.0, range_m=25.0), vehicle=VehicleSpec("hummingbird", PLACE))
UNKNOWN = {"charge_mass_kg": Free(True), "charge_range_m": Free(True)}


def log(**readings):
    values, sigmas = zip(*readings.values(), strict=True)
    return observed(("imu",) * len(values), tuple(readings), values, sigmas)


@pytest.mark.slow
def test_a_jolt_alone_leaves_a_curve_of_masses_and_ranges():
    result = fit(
        log(jolt_velocity_m_s=(0.117, 0.003)), UncertainScene(SCENE, beliefs=UNKNOWN)
    )
    (null,) = result.summary.null_directions
    assert set(null.parameters) == {"charge_mass_kg", "charge_range_m"}
    assert not result.summary.identifiable
    assert result.exit_code == 4
    # along the direction the reading stays; it may be anywhere on the curve
    names = result.answer.names
    along = np.array([null.parameters[name] for name in names])
    against = along * np.where(np.array(names) == "charge_mass_kg", -1.0, 1.0)
    moves = 0.01 * np.stack([0 * along, along, against])
    read = result.density.seen_with(result.answer.values * np.exp(moves)).predicted
    here, same, other = read[:, 0]
    # a curve bends; a lighter charge farther away differs in the first order
    assert abs(same - here) < 0.05 * abs(other - here)


@pytest.mark.slow
def test_with_a_flash_and_its_arrival_a_jolt_tells_the_charge():
    readings = {
        "flash_time_s": (0.0, 1e-3),
        "air_arrival_s": (0.0577, 1e-3),
        "jolt_velocity_m_s": (0.117, 0.003),
    }
    unknown = UNKNOWN | {"origin_time_s": Free(False)}
    result = fit(log(**readings), UncertainScene(SCENE, beliefs=unknown))
    assert result.summary.identifiable
    mass = result.summary.estimates["charge_mass_kg"]
    # 15 % and 15 % of the law, by a slope of 1.1 in ln
    assert 0.15 < mass.log_sd < 0.35
