"""What the laws say of every sensor and blast, by the laws that `simulate` takes.

A record is made from the same laws, so that its front, peak, impulse and duration are
those that a log of the same scene would hold without errors.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jblast.errors import InputError
from jblast.kept_programs import kept
from jblast.registry import names_for
from jblast.scene import Scene, Sensor
from jblast.sensors.bursts import height_notes, settled
from jblast.sensors.law_choice import law_names, resolve_laws
from jblast.sensors.layout import Layout, planned_layout
from jblast.sensors.record import Recording, record

QUANTITIES = (
    "air_arrival_s",
    "ground_arrival_s",
    "peak_overpressure_pa",
    "positive_impulse_pa_s",
    "positive_duration_s",
    "ground_peak_velocity_m_s",
    "ground_displacement_m",
)
"""What is told of every sensor and blast, where there is a law for it."""


class Truth(NamedTuple):
    """What the laws say, by sensor and blast.

    Attributes:
        values: By quantity: a row for each sensor, a column for each charge. Times are
            by the sensor's own clock; of a charge that never happens they are infinite.
        valid: Likewise, whether the quantity's law holds there.
        shots: Names of the charges, "" where there is one.
        laws: Name of the law of every quantity.
        notes: By which curves charges above the ground were taken.
    """

    values: dict[str, Float[np.ndarray, "sensor shot"]]
    valid: dict[str, Bool[np.ndarray, "sensor shot"]]
    shots: tuple[str, ...]
    laws: dict[str, str]
    notes: tuple[str, ...]


def truth_of(scene: Scene, sensors: tuple[Sensor, ...]) -> tuple[Scene, Truth]:
    """Return what the laws say of some of a scene's sensors, and the scene settled.

    Args:
        scene: What is there, its numbers drawn.
        sensors: Those that are asked, each with a position.

    Raises:
        InputError: The scene names a law that does not give its quantity.
    """
    quantities = tuple(name for name in QUANTITIES if names_for(name))
    shots = len(scene.charges)
    rows = [(q, s, i) for q in quantities for s in range(shots) for i in sensors]
    layout = Layout(
        quantity=tuple(quantity for quantity, _, _ in rows),
        position=jnp.stack([sensor.position_m for _, _, sensor in rows]),
        slant_range=jnp.full(len(rows), jnp.nan),
        time=jnp.full(len(rows), jnp.nan),
        group=tuple(range(len(rows))),
        shot=tuple(shot for _, shot, _ in rows),
        clock=tuple(sensor.name for *_, sensor in rows),
    )
    scene, layout = settled(scene, layout)
    laws = law_names(resolve_laws(scene, layout)) | _laws_of_readings(scene)
    laws = {name: laws[name] for name in quantities}
    read = _recorded(scene, layout, laws)
    shape = (len(quantities), shots, len(sensors))
    value = np.asarray(read.value).reshape(shape).transpose(0, 2, 1)
    valid = np.asarray(read.valid).reshape(shape).transpose(0, 2, 1)
    return scene, Truth(
        values=dict(zip(quantities, value, strict=True)),
        valid=dict(zip(quantities, valid, strict=True)),
        shots=tuple(charge.name for charge in scene.charges),
        laws=laws,
        notes=tuple(
            f"note: {note}"
            for shot in range(shots)
            for note in height_notes(scene, layout, shot)
        ),
    )


@kept
def _recorded(scene: Scene, layout: Layout, laws: dict[str, str]) -> Recording:
    return record(scene, layout, laws)


def _laws_of_readings(scene: Scene) -> dict[str, str]:
    """Return the laws by which `simulate` writes what the sensors say they record."""
    try:
        layout, sigma, _ = planned_layout(scene)
    except InputError:  # they record nothing but sound
        return {}
    scene, layout = settled(scene, layout)
    return law_names(resolve_laws(scene, layout, np.asarray(sigma)))
