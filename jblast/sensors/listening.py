"""The records of every sensor of a scene, and their true values.

`plan` finds the sensors that record samples, the duration, and the waves that reach
them. A record begins at 0 on its sensor's own clock, so that a time in it is the
reading of `simulate`. The truth of every sensor and blast is calculated by the laws of
`simulate`. A record is made from the same laws, so that its front, peak, impulse and
duration are those of an error-free log of the same scene. `packets` yields the samples
of a sensor of any kind, whole or packet by packet.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Bool, Float, Int, PRNGKeyArray

from jblast.errors import InputError, argument, shown
from jblast.kept_programs import kept
from jblast.observations.records.sound import read_sound
from jblast.registry import names_for
from jblast.scene import Ambient, Instrument, Scene, Sensor, UncertainScene, draw_scene
from jblast.scene.sensor_kinds import SENSOR_KINDS, sampling_kinds
from jblast.scene.uncertain import value_of
from jblast.sensors.arrivals import Track, places_met
from jblast.sensors.law_choice import height_notes, law_names, resolve_laws, settled
from jblast.sensors.layout import Layout, planned_layout
from jblast.sensors.record import Recording, record
from jblast.sensors.wave_paths import record_laws

TAIL_S = 0.25
"""Least duration of a record after the last arrival [s]."""
DURATIONS = 10.0
"""Positive phases after an arrival until suction and ground motion are over."""
WITHOUT_BLAST_S = 1.0
"""Duration of a record where no blast arrives [s]."""
LONGEST_S = 600.0
"""Longest record without a requested duration [s]."""
MOST_SAMPLES = 2**30 - 2**14
"""Of a sound file: samples of four bytes, sizes of 32 bits."""
QUANTITIES = (
    "air_arrival_s",
    "ground_arrival_s",
    "peak_overpressure_pa",
    "positive_impulse_pa_s",
    "positive_duration_s",
    "ground_peak_velocity_m_s",
    "ground_displacement_m",
)
"""Quantities of the truth of every sensor and blast, where there is a law."""


class Truth(NamedTuple):
    """Values by the laws, by sensor and blast.

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


class Listening(NamedTuple):
    """Records to be made.

    Attributes:
        scene: What is there, its numbers drawn and its curve sets settled.
        sensors: Those that write samples, in the scene's order.
        skipped: Why each of the others writes none, by name.
        seconds: How long each record lasts, from 0 on its sensor's clock.
        truth: Of `sensors`, by the laws.
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
    """Return a sensor's instrument: one that adds nothing if it has none."""
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
            record would be too long, or the last blast comes so late that a duration is
            required.
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
    """Return the settled scene, its truth, and other scenes and laws by kind."""
    own_scene, truth = truth_of(scene, sensors, tracks)
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
    return own_scene, truth, otherwise


def _rows_of(
    own: np.ndarray, ours: dict[str, Any], others: dict[str, Any]
) -> dict[str, Any]:
    """Return some sensors' rows of one truth, the others' of another."""
    return {name: np.where(own, ours[name], rows) for name, rows in others.items()}


def _heard(
    scene: Scene, source: str, tracks: Mapping[str, Track]
) -> tuple[list[Sensor], dict[str, str]]:
    """Return the sensors that write samples, and why others do not."""
    sampling = sampling_kinds()
    expected = f"[[sensor]] of kind {', '.join(sampling)}"
    if not scene.sensors:
        raise InputError(f"{source}: expected at least one {expected}; got no sensor")
    skipped = {
        sensor.name: f"kind {sensor.kind} writes no samples over time"
        if sensor.kind
        else "its kind is not said"
        for sensor in scene.sensors
        if sensor.kind not in sampling
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
        is_sound = SENSOR_KINDS[sensor.kind].file == ".wav"
        if is_sound and rate != round(rate):
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


def packets(
    listening: Listening, sensor: Sensor, packets_hz: float | None = None
) -> Iterator[Float[np.ndarray, "sample component"]]:
    """Yield a sensor's samples, in the unit of its kind, as many as its record has.

    Args:
        listening: What is to be recorded.
        sensor: One of its sensors.
        packets_hz: Packets a second; None: all samples at once.

    Raises:
        InputError: A packet would hold no sample.
    """
    rate_hz, left = instrument_of(sensor).rate, samples_of(listening, sensor)
    if packets_hz is not None and packets_hz > rate_hz:
        raise InputError(
            f"{argument('packets')}: expected at most {rate_hz:g} packets a second, "
            f"the samples of sensor {sensor.name!r}, got {packets_hz:g}"
        )
    recorder = SENSOR_KINDS[sensor.kind].samples()
    number = [other.name for other in listening.sensors].index(sensor.name)
    key = jax.random.fold_in(listening.key, number)
    scene, laws = listening.heard_by(sensor)
    carried = {}  # those that can ride along take a track
    if sensor.name in listening.tracks:
        carried = {"track": listening.tracks[sensor.name]}
    try:
        if packets_hz is None:
            samples = recorder.record(
                scene, sensor, listening.seconds, key, laws=laws, **carried
            )
            yield _by_component(samples)
            return
        stream = recorder.stream(
            scene, sensor, key, packets_hz=packets_hz, laws=laws, **carried
        )
    except InputError as error:
        if shown(sensor.name) in str(error):
            raise
        raise InputError(f"sensor {sensor.name!r}: {error}") from None
    for packet in stream:
        samples = _by_component(packet.samples)[:left]
        yield samples
        left -= len(samples)
        if left <= 0:
            return


def _by_component(samples: ArrayLike) -> Float[np.ndarray, "sample component"]:
    """Return samples with a column for each component: pressure has one, wind three."""
    samples = np.asarray(samples)
    return samples[:, None] if samples.ndim == 1 else samples


def truth_of(
    scene: Scene,
    sensors: tuple[Sensor, ...],
    tracks: Mapping[str, Track] | None = None,
    asked: Sequence[str] = QUANTITIES,
) -> tuple[Scene, Truth]:
    """Return the truth of some of a scene's sensors, and the settled scene.

    Args:
        scene: What is there, its numbers drawn.
        sensors: For which, each with a position or a track.
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
    """Return the laws by which `simulate` writes the readings of the sensors."""
    try:
        layout, sigma, _ = planned_layout(scene)
    except InputError:  # they record nothing but sound
        return {}
    scene, layout = settled(scene, layout)
    return law_names(resolve_laws(scene, layout, np.asarray(sigma)))


def with_ambient(
    uncertain: UncertainScene, file: str | None = None
) -> tuple[UncertainScene, list[str]]:
    """Return a scene whose ambient recording has been read, and notes on it.

    Args:
        uncertain: The scene. Its [ambient] may name a recording.
        file: A recording in place of the scene's; a sample of 1 in it is the scene's
            `full_scale_pa` of [ambient].

    Raises:
        InputError: The file cannot be used, see `read_sound`.
    """
    ambient = uncertain.scene.ambient
    if file is not None:
        said = ambient or Ambient()
        ambient = Ambient(file=file, height=said.height, full_scale=said.full_scale)
    if ambient is None or not ambient.file:
        return uncertain, []
    sound = read_sound(ambient.file)
    if (count := sound.samples.shape[1]) < 2:
        raise InputError(f"{ambient.file}: expected two samples or more, got {count}")
    notes = [f"ambient sound: a loop of {ambient.file}, {sound.seconds:g} s"]
    if len(sound.samples) > 1:
        notes.append(f"of its {len(sound.samples)} channels the first is heard")
    if 0 in sound.dead_channels:
        notes.append("the ambient recording is silent")
    loop = ambient.full_scale * jnp.asarray(sound.samples[0])
    ambient = replace(ambient, loop=loop, loop_rate=float(sound.rate_hz))
    return replace(uncertain, scene=replace(uncertain.scene, ambient=ambient)), notes
