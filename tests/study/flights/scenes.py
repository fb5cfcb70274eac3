"""A charge and a Crazyflie beside it, flown for a short while."""

from typing import Any

import jax.numpy as jnp

from jblast.scene import Charge, Scene, UncertainScene, VehicleSpec

PLACE = jnp.array([5.0, 0.0, 2.0])
SPEC = VehicleSpec("crazyflie", PLACE)
SHORT: dict[str, Any] = {"seconds": 0.6, "step_s": 2e-3}


def scene(spec: VehicleSpec | None = SPEC, **parts) -> UncertainScene:
    charge = parts.pop("charge", Charge(mass_kg=1.0))
    beliefs = parts.pop("beliefs", {})
    made = Scene(charge, vehicle=spec, **parts)
    return UncertainScene(made, beliefs, "scene.toml")
