"""What the laws say of every sensor and blast, by the laws that `simulate` takes.

A record is made from the same laws, so that its front, peak, impulse and duration are
those that a log of the same scene would hold without errors.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from jblast.errors import InputError
from jblast.kept_programs import kept
from jblast.registry import names_for
from jblast.scene import Scene, Sensor
from jblast.sensors.arrivals.laws import record_laws
from jblast.sensors.arrivals.places_met import places_met
from jblast.sensors.arrivals.track import Track
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
        places: Likewise, where the sensor is as the wave of the quantity comes: east,
            north, up [m].
    """

    values: dict[str, Float[np.ndarray, "sensor shot"]]
    valid: dict[str, Bool[np.ndarray, "sensor shot"]]
    shots: tuple[str, ...]
    laws: dict[str, str]
    notes: tuple[str, ...]
    places: dict[str, Float[np.ndarray, "sensor shot 3"]]


def truth_of(
    scene: Scene,
    sensors: tuple[Sensor, ...],
    tracks: Mapping[str, Track] | None = None,
    asked: Sequence[str] = QUANTITIES,
) -> tuple[Scene, Truth]:
    """Return what the laws say of some of a scene's sensors, and the scene settled.

    Args:
        scene: What is there, its numbers drawn.
        sensors: Those that are asked, each with a position or a track.
        tracks: By name, where those that move are over time.
        asked: Quantities.

    Raises:
        InputError: The scene names a law that does not give its quantity.
    """
    tracks = tracks or {}
    quantities = tuple(name for name in asked if names_for(name))
    shots = len(scene.charges)
    start = {i.name: i.position_m for i in sensors}
    start |= {name: track.position[0] for name, track in tracks.items()}
    rows = [(q, s, i) for q in quantities for s in range(shots) for i in sensors]
    layout = Layout(
        quantity=tuple(quantity for quantity, _, _ in rows),
        position=jnp.stack([start[sensor.name] for _, _, sensor in rows]),
        slant_range=jnp.full(len(rows), jnp.nan),
        time=jnp.full(len(rows), jnp.nan),
        group=tuple(range(len(rows))),
        shot=tuple(shot for _, shot, _ in rows),
        clock=tuple(sensor.name for *_, sensor in rows),
    )
    scene, layout = settled(scene, layout)
    laws = law_names(resolve_laws(scene, layout)) | _laws_of_readings(scene)
    laws = {name: laws[name] for name in quantities}
    if tracks:
        named = record_laws(scene, laws, ground=True)
        met = {name: places_met(scene, one, named) for name, one in tracks.items()}
        places = [
            met[i.name].of(quantity)[shot] if i.name in met else i.position_m
            for quantity, shot, i in rows
        ]
        layout = replace(layout, position=jnp.stack([*map(jnp.asarray, places)]))
    shape = (len(quantities), shots, len(sensors))
    numbers = np.arange(len(rows)).reshape(shape)
    read = [
        _recorded(*_of_one(scene, layout, shot, numbers[:, shot].ravel()), laws)
        for shot in range(shots)
    ]
    value, valid = (
        np.stack([np.reshape(x, shape[::2]) for x in column], axis=-1)
        for column in ([x.value for x in read], [x.valid for x in read])
    )
    place = np.asarray(layout.position).reshape(*shape, 3).transpose(0, 2, 1, 3)
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
        places=dict(zip(quantities, place, strict=True)),
    )


@kept
def _recorded(scene: Scene, layout: Layout, laws: dict[str, str]) -> Recording:
    return record(scene, layout, laws)


def _of_one(
    scene: Scene, layout: Layout, shot: int, rows: Int[np.ndarray, " row"]
) -> tuple[Scene, Layout]:
    """Return the scene with one charge, and its rows: one program for all charges."""
    charge = replace(scene.charges[shot], name="")
    own = tuple(range(len(rows)))
    only = replace(layout.only(rows), shot=(0,) * len(rows), group=own)
    return replace(scene, charge=charge, others=()), only


def _laws_of_readings(scene: Scene) -> dict[str, str]:
    """Return the laws by which `simulate` writes what the sensors say they record."""
    try:
        layout, sigma, _ = planned_layout(scene)
    except InputError:  # they record nothing but sound
        return {}
    scene, layout = settled(scene, layout)
    return law_names(resolve_laws(scene, layout, np.asarray(sigma)))
