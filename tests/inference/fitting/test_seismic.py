"""Ground motion alone bounds a charge mass; it does not identify it."""

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference import fit
from jblast.scene import Charge, Scene, UncertainScene, freed
from jblast.waves import ground_motion_displacement, ground_motion_velocity
from tests.inference.logs import log

PLACES = {"a": 400.0, "b": 900.0, "c": 1500.0}
BURIED = -3.0


@pytest.mark.slow
def test_seismic_rows_alone_bound_a_mass_as_far_as_rocks_are_alike():
    distance = np.array([*PLACES.values()])
    readings = {
        "ground_displacement_m": ground_motion_displacement,
        "ground_peak_velocity_m_s": ground_motion_velocity,
    }
    rows = [
        (name, quantity, value, 0.05 * value, (far, 0.0, BURIED))
        for quantity, law in readings.items()
        for (name, far), value in zip(
            PLACES.items(), np.asarray(law(distance, 300.0, BURIED)), strict=True
        )
    ]
    scene = Scene(Charge(mass_kg=jnp.asarray(100.0), position_m=(0.0, 0.0, BURIED)))
    free = freed(UncertainScene(scene), ["charge_mass_kg"])
    answer = fit(log(*rows), free).summary
    mass = answer.estimates["charge_mass_kg"]
    assert set(answer.law.values()) == {"ground_motion"}
    # at the answer; small masses of the interval are deeper than the law reaches
    assert answer.law_valid_rows == len(rows)
    assert mass.q05 < 300.0 < mass.q95
    # Shots of a new site share 1.90 and 2.05 in ln; a displacement grows as W^0.82, a
    # velocity as W^0.66: 1 / (0.82^2 / 1.90^2 + 0.66^2 / 2.05^2) is 1.86^2, more with
    # path and record scatter, so the 90 % interval spans a factor above 30
    assert 1.6 < np.log(mass.q95 / mass.q05) / (2 * 1.645) < 2.6
    assert not mass.identified
