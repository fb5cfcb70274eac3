"""Flights by an estimate: a batch is told as one is, and nobody falls."""

import numpy as np
import pytest

from jblast.scene import Charge, Scene, UncertainScene, VehicleSpec
from jblast.scene.uncertain import Normal
from jblast.study.flights import fly


@pytest.mark.slow
def test_a_batch_flies_by_its_estimates_through_a_blast():
    vehicle = VehicleSpec("iris", position=np.array([8.0, 0.0, 10.0]), integral=True)
    scene = Scene(Charge(10.0, time_s=2.0), vehicle=vehicle)
    uncertain = UncertainScene(scene, {"charge_mass_kg": Normal(10.0, 0.5)})
    flights = fly(uncertain, seconds=4.0, estimator="ekf", vehicles=3, seed=4)
    found = flights.holds["with_integral"]
    assert found.thrown is not None
    places = np.asarray(found.thrown.place_m)
    assert places.shape == (3, 1)
    # each has instruments of its own
    assert len(np.unique(places)) == 3
    assert (places < 1.0).all()
    assert not np.asarray(found.metrics.crashed).any()
    assert np.asarray(found.metrics.peak_deviation_m).max() < 2.0
