"""Which sensors of a scene are heard, for how long, and what blast reaches them when.

A record begins at 0 on its sensor's own clock, so that a time in it is what `simulate`
would write down.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import PRNGKeyArray

from jblast.errors import InputError, argument
from jblast.scene import Instrument, Scene, Sensor, UncertainScene, draw_scene
from jblast.scene.reader.tables import INSTRUMENT_KINDS
from jblast.scene.uncertain import value_of
from jblast.sensors.arrivals.track import Track
from jblast.sensors.listening.truth import Truth, truth_of

TAIL_S = 0.25
"""What is heard after the last blast, at least."""
DURATIONS = 10.0
"""So many positive phases after an arrival, its suction and the ground are still."""
WITHOUT_BLAST_S = 1.0
"""How long is listened where no blast ever comes."""
LONGEST_S = 600.0
"""What is recorded unasked: past it, somebody should have said how long."""

MOST_SAMPLES = 2**30 - 2**14
"""That a sound file of four bytes each may hold, its sizes being of 32 bits."""


class Listening(NamedTuple):
    """What is to be recorded.

    Attributes:
        scene: What is there, its numbers drawn and its curve sets settled.
        sensors: Those that write samples, in the scene's order.
        skipped: Why each of the others writes none, by name.
        seconds: How long each record lasts, from 0 on its sensor's clock.
        truth: What the laws say of `sensors`.
        notes: What was drawn of priors, and by which curves charges were taken.
        key: Of all noise.
        tracks: By name, where sensors that move are over time.
        otherwise: By kind, the scene and the laws of sensors to which it is another.
    """

    scene: Scene
    sensors: tuple[Sensor, ...]
    skipped: dict[str, str]
    seconds: float
    truth: Truth
    notes: tuple[str, ...]
    key: PRNGKeyArray
    tracks: Mapping[str, Track]
    otherwise: Mapping[str, tuple[Scene, Mapping[str, str]]]

    def heard_by(self, sensor: Sensor) -> tuple[Scene, Mapping[str, str]]:
        """Return the scene and the laws by which a sensor's record is made."""
        return self.otherwise.get(sensor.kind, (self.scene, self.truth.laws))


def instrument_of(sensor: Sensor) -> Instrument:
    """Return a sensor's instrument: one that adds nothing where none is told."""
    return Instrument() if sensor.instrument is None else sensor.instrument


def samples_of(listening: Listening, sensor: Sensor) -> int:
    """Return how many samples a sensor's record has."""
    return max(1, round(listening.seconds * instrument_of(sensor).rate))


def plan(
    uncertain: UncertainScene,
    seed: int = 0,
    seconds: float | None = None,
    tracks: Mapping[str, Track] | None = None,
    scene_of: Callable[[Scene, str], Scene] | None = None,
) -> Listening:
    """Return what a scene's sensors are to record.

    Args:
        uncertain: The scene; numbers with a prior are drawn as `simulate` draws them.
        seed: Of the priors and the noise.
        seconds: How long; None: until the last blast has gone by everywhere.
        tracks: By name, where sensors on a vehicle are over time.
        scene_of: The scene as sensors of a kind have it; None: one for all.

    Raises:
        InputError: No sensor writes samples, one has no position, a charge has none, a
            record would be too long, or the last blast comes so late that somebody
            should say how long.
    """
    scene_key, noise_key = jax.random.split(jax.random.key(seed))
    source = uncertain.source or "scene"
    tracks = {} if tracks is None else tracks
    sensors, skipped = _heard(uncertain.scene, source, tracks)
    scene = draw_scene(scene_key, uncertain)
    if any(charge.range_m is not None for charge in scene.charges):
        raise InputError(
            f"{source}: [charge] range_m: expected position_m, from which sound comes "
            "to every sensor, got a distance alone"
        )
    places = {sensor.name: sensor for sensor in scene.sensors}
    sensors = tuple(places[sensor.name] for sensor in sensors)
    own = {i.name: tracks[i.name] for i in sensors if i.name in tracks}
    scene, truth, otherwise = _truths(scene, sensors, own, scene_of)
    drawn = [
        f"truth: {name} = {float(np.asarray(value_of(scene, name)))!r}"
        for name in uncertain.beliefs
    ]
    if seconds is None:
        seconds = _until_gone_by(truth, source)
    _check_rates(sensors, seconds, source)
    notes = (*drawn, *truth.notes)
    return Listening(
        scene, sensors, skipped, seconds, truth, notes, noise_key, own, otherwise
    )


def _truths(
    scene: Scene,
    sensors: tuple[Sensor, ...],
    tracks: Mapping[str, Track],
    scene_of: Callable[[Scene, str], Scene] | None,
) -> tuple[Scene, Truth, dict[str, tuple[Scene, Mapping[str, str]]]]:
    """Return the scene settled, what its laws say, and by kind who has another one."""
    settled, truth = truth_of(scene, sensors, tracks)
    otherwise: dict[str, tuple[Scene, Mapping[str, str]]] = {}
    kinds = dict.fromkeys(sensor.kind for sensor in sensors) if scene_of else ()
    for kind in kinds:
        other = scene if scene_of is None else scene_of(scene, kind)
        if other is scene:
            continue
        other, theirs = truth_of(other, sensors, tracks)
        otherwise[kind] = other, theirs.laws
        own = np.array([sensor.kind == kind for sensor in sensors])[:, None]
        truth = truth._replace(
            values=_rows_of(own, theirs.values, truth.values),
            valid=_rows_of(own, theirs.valid, truth.valid),
            places=_rows_of(own[..., None], theirs.places, truth.places),
        )
    return settled, truth, otherwise


def _rows_of(
    own: np.ndarray, ours: dict[str, Any], others: dict[str, Any]
) -> dict[str, Any]:
    """Return some sensors' rows of one truth, the others' of another."""
    return {name: np.where(own, ours[name], rows) for name, rows in others.items()}


def _heard(
    scene: Scene, source: str, tracks: Mapping[str, Track]
) -> tuple[list[Sensor], dict[str, str]]:
    """Return the sensors that write samples, and why others do not."""
    expected = f"[[sensor]] of kind {', '.join(INSTRUMENT_KINDS)}"
    if not scene.sensors:
        raise InputError(f"{source}: expected at least one {expected}; got no sensor")
    skipped = {
        sensor.name: f"kind {sensor.kind} writes no samples over time"
        if sensor.kind
        else "its kind is not said"
        for sensor in scene.sensors
        if sensor.kind not in INSTRUMENT_KINDS
    }
    heard = [sensor for sensor in scene.sensors if sensor.name not in skipped]
    if not heard:
        name, why = next(iter(skipped.items()))
        raise InputError(
            f"{source}: expected at least one {expected}; of sensor {name!r}, {why}"
        )
    for sensor in heard:
        if sensor.name in tracks:
            continue
        if sensor.mount:
            raise InputError(
                f"{source}: [[sensor]] {sensor.name!r} mount: expected a flight of the "
                f"{sensor.mount} that carries it, which jblast world flies; got none"
            )
        if not np.isfinite(sensor.position_m).all():
            raise InputError(
                f"{source}: [[sensor]] {sensor.name!r}: expected position_m = "
                "[east, north, up], got nothing"
            )
    return heard, skipped


def _check_rates(sensors: tuple[Sensor, ...], seconds: float, source: str) -> None:
    """Refuse what no sound file holds: part of a hertz, more than 32-bit sizes."""
    for sensor in sensors:
        rate = instrument_of(sensor).rate
        where = f"{source}: [[sensor]] {sensor.name!r}"
        if sensor.kind == "microphone" and rate != round(rate):
            raise InputError(
                f"{where} rate_hz: expected a whole number, which a sound file holds, "
                f"got {rate:g}"
            )
        if not 1 <= seconds * rate <= MOST_SAMPLES:
            raise InputError(
                f"{argument('seconds')}: expected 1 to {MOST_SAMPLES:,} samples at "
                f"{rate:g} Hz, of sensor {sensor.name!r}; got {seconds:g} s"
            )


def _until_gone_by(truth: Truth, source: str) -> float:
    """Return how long until every blast has gone by every sensor."""
    values = truth.values
    after = np.maximum(DURATIONS * values["positive_duration_s"], TAIL_S)
    ends = [values[name] + after for name in ("air_arrival_s", "ground_arrival_s")]
    ends = np.concatenate([end[np.isfinite(end)] for end in ends])
    last = float(ends.max(initial=-math.inf))
    if last <= 0.0:  # none comes, or all came before the clock began
        return WITHOUT_BLAST_S
    if last > LONGEST_S:
        raise InputError(
            f"{source}: the last blast has gone by {last:.6g} s after the clocks' 0, "
            f"where records begin; expected {argument('seconds')}, or a charge's "
            f"time_s that ends a record within {LONGEST_S:g} s"
        )
    return math.ceil(10.0 * last) / 10.0
