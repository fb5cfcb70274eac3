"""Rings about the charge: against the calculator, the forward model and scaling."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference.fitting.place import LEVELS, peak_law, shock_rings
from jblast.scene import Charge, Sensor
from jblast.sensors.forward_model import record
from jblast.sensors.layout import planned_layout
from tests.report.example import not_identifiable, shock_radius, three_parameters
from tests.report.made_up import changed

MASS = 209.0


def test_a_sensor_on_a_ring_reads_its_pressure():
    fit = three_parameters()
    scene = replace(fit.scene, sensors=())
    rings = shock_rings(fit)
    assert [ring.peak_overpressure_pa for ring in rings] == list(LEVELS)
    sensors = tuple(
        Sensor(
            f"r{i}",
            jnp.array([0.0, ring.range_m, 0.0]),
            records=(("peak_overpressure_pa", 0.1),),
        )
        for i, ring in enumerate(rings)
    )
    scene = replace(scene, sensors=sensors)
    layout, _, _ = planned_layout(scene)
    read = record(scene, layout, {"peak_overpressure_pa": "kingery_bulmash"})
    # the range is to 1e-5, the pressure falls with up to its third power
    assert np.asarray(read.value) == pytest.approx(np.array(LEVELS), rel=1e-4)
    assert [bool(v) for v in read.valid] == [ring.valid for ring in rings]


def test_rings_grow_with_the_cube_root_of_the_mass():
    fit = three_parameters()
    estimate = fit.summary.estimates["charge_mass_kg"]
    for ring in shock_rings(fit):
        assert ring.law == "kingery_bulmash"
        for told, mass in (
            (ring.range_q05_m, estimate.q05),
            (ring.range_q95_m, estimate.q95),
        ):
            grown = ring.range_m * np.cbrt(mass / MASS)
            assert told == pytest.approx(grown, rel=1e-5)


def test_a_charge_above_the_ground_has_narrower_rings():
    fit = three_parameters()
    low = shock_rings(fit, levels=[100e3])[0].range_m
    raised = replace(
        fit.scene,
        charges=(Charge(mass_kg=MASS, position_m=(0.0, 0.0, 10.0), burst="surface"),),
    )
    high = shock_rings(changed(fit, scene=raised), levels=[100e3])[0].range_m
    assert high == pytest.approx(np.sqrt(low**2 - 100.0), rel=1e-5)
    raised = replace(
        fit.scene,
        charges=(Charge(mass_kg=MASS, position_m=(0.0, 0.0, 500.0), burst="surface"),),
    )
    assert shock_rings(changed(fit, scene=raised), levels=[100e3]) == ()


def test_without_a_mass_or_a_law_of_the_peak_there_are_none():
    assert peak_law(shock_radius()) is None
    assert shock_rings(shock_radius()) == ()
    assert shock_rings(not_identifiable()) == ()
