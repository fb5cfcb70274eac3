"""What `test_float32.py` asks of a process of its own, where JAX is in float32.

    python single_precision.py

Prints a JSON object, an entry a question.
"""

import dataclasses
import json
import sys
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jblast.inference import fit
from jblast.observations import Observations
from jblast.registry import LAWS, call
from jblast.scene import Charge, Free, Scene, Sensor, UncertainScene
from jblast.sensors import Layout, planned_layout, record
from jblast.waves import Path, kingery_bulmash_pressure

LAW_NAMES = {
    "air_arrival_s": "shock_kinematics",
    "peak_overpressure_pa": "shock_kinematics",
    "positive_impulse_pa_s": "kingery_bulmash",
}


def summary_of(tree: Any) -> list[tuple[str, bool]]:
    """Of each array: its dtype, and whether all of it is finite."""
    return [(x.dtype.name, bool(jnp.isfinite(x).all())) for x in jax.tree.leaves(tree)]


def laws() -> dict[str, list[tuple[str, bool]]]:
    """Evaluate every law 3 m to 3 km from a charge, or as many seconds after it."""
    along = jnp.geomspace(3.0, 3000.0, 7)
    path = Path(
        slant_range=along,
        ground_range=along,
        time_since_detonation=along,
        sensor_height=jnp.array(0.0),
        temperature=jnp.asarray(280.0),
        relative_humidity=jnp.asarray(0.5),
        charge_mass=jnp.asarray(15.0),
        height_of_burst=jnp.asarray(0.5),
        ambient_pressure=jnp.asarray(9e4),
        sound_speed=jnp.asarray(340.0),
        air_density=jnp.asarray(1.2),
        p_speed=jnp.asarray(5000.0),
        sedov_gamma=jnp.asarray(1.3),
        toward_east=along,
        toward_north=along,
        toward_up=along,
        fireball_growth=jnp.asarray(3e-3),
        camera_focal=jnp.asarray(1e3),
        jolt_east=along,
        jolt_north=along,
        jolt_up=along,
    )

    @eqx.filter_jit
    def all_of_them(path: Path) -> dict[str, Any]:
        return {
            f"{quantity} {name}": call(law.function, path)
            for (quantity, name), law in LAWS.items()
        }

    return {name: summary_of(told) for name, told in all_of_them(path).items()}


def recording() -> dict[str, list[tuple[str, bool]]]:
    """Record a scene, and take the gradient of all readings to all its numbers."""
    places = np.array([[20.0, 0.0, 1.5], [-40.0, 30.0, 1.5], [0.0, -90.0, 1.5]])
    records = tuple((quantity, 0.05) for quantity in LAW_NAMES)
    scene = Scene(
        Charge(mass_kg=15.0, burst="surface"),
        sensors=tuple(
            Sensor(f"s{i}", position_m=place, records=records)
            for i, place in enumerate(places)
        ),
    )
    layout, _, _ = planned_layout(scene)

    def total(scene: Scene, layout: Layout):
        return record(scene, layout, LAW_NAMES).value.sum()

    return {
        "recording": summary_of(eqx.filter_jit(record)(scene, layout, LAW_NAMES)),
        "gradient": summary_of(eqx.filter_jit(eqx.filter_grad(total))(scene, layout)),
    }


def fitted() -> dict[str, Any]:
    """Fit the mass to the pressures that 15 kg make at three ranges."""
    ranges = np.array([10.0, 20.0, 40.0])
    pressure = np.asarray(kingery_bulmash_pressure(ranges, 15.0), float)
    nothing = np.full(3, np.nan)
    log = Observations(
        sensor=("a", "b", "c"),
        quantity=("peak_overpressure_pa",) * 3,
        value=pressure,
        sigma=0.1 * pressure,
        position=np.full((3, 3), np.nan),
        slant_range=ranges,
        time=nothing,
        path=("",) * 3,
        shot=("",) * 3,
        clock=("",) * 3,
    )
    exact = dataclasses.replace(Scene(), scatter=False)
    uncertain = UncertainScene(exact, {"charge_mass_kg": Free(positive=True)})
    answer = fit(log, uncertain)
    return answer.to_dict()


if __name__ == "__main__":
    questions = {"laws": laws, "recording": recording, "fit": fitted}
    answers = {name: answer() for name, answer in questions.items()}
    sys.stdout.write(json.dumps(answers))
