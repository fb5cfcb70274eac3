"""A charge is weighed by how far and how fast it moved the ground."""

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
def test_seismic_rows_weigh_a_charge_as_well_as_rocks_are_alike():
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
    scene = Scene(
        charge=Charge(mass_kg=jnp.asarray(100.0), position_m=(0.0, 0.0, BURIED))
    )
    free = freed(UncertainScene(scene), ["charge_mass_kg"])
    answer = fit(log(*rows), free, posterior="laplace").summary
    mass = answer.estimates["charge_mass_kg"]
    assert set(answer.law.values()) == {"ground_motion"}
    assert answer.law_valid
    assert mass.q05 < 300.0 < mass.q95
    # shots of one site share 1.28 and 0.61 in ln; a displacement grows as W^0.81, a
    # velocity as W^0.61: 1 / (0.81^2 / 1.28^2 + 0.61^2 / 0.61^2) is 0.85^2, more with
    # what each path and record adds and the coefficients do not know
    assert 0.85 < mass.log_sd < 1.5
