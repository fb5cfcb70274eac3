"""Five microphones about a charge: few readings more than unknowns.

Four unknowns (mass, place in the plane, time), no prior; laws exact or scattering. A
normal approximation is weakest there.
"""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp

from jblast.inference import Posterior
from jblast.inference.posterior.parameters import parameters_of
from jblast.scene import Scene, Sensor, UncertainScene, freed, with_values
from jblast.sensors import observe, planned_layout
from jblast.sensors.record import to_error_scale

PLACES = ((60, 0), (-70, 30), (0, 90), (20, -80), (120, 100))
"""East and north of each microphone [m]."""
RECORDS = (("air_arrival_s", 1e-4), ("peak_overpressure_pa", 0.02))
TRUTH = {
    "charge_mass_kg": 30.0,
    "charge_east_m": 10.0,
    "charge_north_m": -5.0,
    "origin_time_s": 1.5,
}
LAWS = {quantity: "shock_kinematics" for quantity, _ in RECORDS}
SEED = 11


def scene_with(
    *, scatter: bool, places: Sequence[tuple[float, float]] = PLACES
) -> Scene:
    """Return microphones about a charge, laws exact or scattering."""
    sensors = tuple(
        Sensor(f"m{i}", jnp.array([*place, 1.5]), records=RECORDS)
        for i, place in enumerate(places)
    )
    empty = dataclasses.replace(Scene(), scatter=scatter, sensors=sensors)
    return with_values(empty, TRUTH)


def one_posterior() -> Posterior:
    """Return the posterior of one simulated log, laws exact, Student-t errors."""
    scene = scene_with(scatter=False)
    layout, sigma, _ = planned_layout(scene)
    read = observe(jax.random.key(SEED), scene, layout, LAWS, sigma)
    parameters = parameters_of(freed(UncertainScene(scene), list(TRUTH)))
    measured = to_error_scale(read, layout.quantity)
    return Posterior(parameters, layout, measured, sigma, tuple(LAWS.items()))
