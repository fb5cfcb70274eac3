"""The records of every sensor of a scene, and their true values.

`plan` finds the sensors that record samples, the duration, and the waves that reach
them. A record begins at 0 on its sensor's own clock, so that a time in it is the
reading of `simulate`. The true values of every sensor and blast are calculated by the
laws of `simulate`. A record uses the same laws, so that its front, peak, impulse and
duration are those of an error-free log of the same scene. `packets` yields the samples
of a sensor of any kind, whole or packet by packet.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, PRNGKeyArray

from jblast.errors import InputError, argument, require
from jblast.kept_programs import kept
from jblast.observations.records.sound import read_sound
from jblast.registry import names_for
from jblast.scene import Ambient, Instrument, Scene, Sensor, UncertainScene, draw_scene
from jblast.scene.sensor_kinds import SENSOR_KINDS, sampling_kinds
from jblast.sensors.forward_model import Recording, record
from jblast.sensors.law_choice import height_notes, law_names, resolve_laws
from jblast.sensors.layout import Layout, planned_layout
from jblast.sensors.recorder import recording
from jblast.sensors.simulated_readings import drawn_values
from jblast.sensors.waves_met import Track, places_met, record_laws

TAIL_S = 0.25
"""Minimum duration of a record after the last arrival [s]."""
DURATIONS = 10.0
"""Positive phases after an arrival until suction and ground motion are over. A pulse's
suction ends after a few; the rest is margin for the ground's decay."""
WITHOUT_BLAST_S = 1.0
"""Duration of a record without a blast [s]: long enough for its ambient sound."""
LONGEST_S = 600.0
"""Longest record without a requested duration [s]. A later blast usually has a wrong
`time_s`, and the file would be large."""
MOST_SAMPLES = 2**30 - 2**14
"""Most samples of a sound file: four bytes each, sizes of 32 bits, less the header."""
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
        values: By quantity: a row per sensor, a column per charge. Times are on the
            sensor's own clock; infinite for a charge that never detonates.
        valid: Likewise, true if the quantity's law holds there.
        shots: Names of the charges; "" if there is one.
        laws: Name of the law of every quantity.
        notes: Curve sets used for charges above the ground.
        places: Likewise, position of the sensor at the arrival of the quantity's wave:
            east, north, up [m].
    """

    values: dict[str, Float[np.ndarray, "sensor shot"]]
    valid: dict[str, Bool[np.ndarray, "sensor shot"]]
    shots: tuple[str, ...]
    laws: dict[str, str]
    notes: tuple[str, ...]
    places: dict[str, Float[np.ndarray, "sensor shot 3"]]


class Listening(NamedTuple):
    """Plan of the records to make.

    Attributes:
        scene: Scene with its numbers drawn.
        sensors: Sensors that record samples, in the scene's order.
        skipped: Reason why each other sensor records none, by name.
        seconds: Duration of each record, from 0 on its sensor's clock.
        truth: True values of `sensors`, by the laws.
        notes: Values drawn from priors, and the curve sets used.
        key: Random key of all noise.
        tracks: Positions over time of moving sensors, by name.
    """

    scene: Scene
    sensors: tuple[Sensor, ...]
    skipped: dict[str, str]
    seconds: float
    truth: Truth
    notes: tuple[str, ...]
    key: PRNGKeyArray
    tracks: Mapping[str, Track]


def plan(
    uncertain: UncertainScene,
    seed: int = 0,
    seconds: float | None = None,
    tracks: Mapping[str, Track] | None = None,
) -> Listening:
    """Return the plan of a scene's records.

    Args:
        uncertain: The scene; numbers with a prior are drawn as in `simulate`.
        seed: Seed of the priors and the noise.
        seconds: Duration; None lasts until the last blast has passed every sensor.
        tracks: Positions over time of sensors on a vehicle, by name.

    Raises:
        InputError: No sensor records samples, a sensor or a charge has no position, a
            record would be too long, or the last blast arrives so late that a duration
            is required.
    """
    scene_key, noise_key = jax.random.split(jax.random.key(seed))
    source = uncertain.source or "scene"
    tracks = {} if tracks is None else tracks
    # as in `simulate` with the same seed: a log and the records agree
    scene = draw_scene(scene_key, uncertain)
    sensors, skipped = _sampling_sensors(scene, source, tracks)
    # sound has a direction of arrival at each sensor: a range alone does not define the
    # paths
    require(
        all(charge.range_m is None for charge in scene.charges),
        f"{source}: [charge] range_m",
        "position_m, which defines the path to every sensor",
        "a range only",
    )
    # tracks of sensors that record nothing are ignored
    own = {i.name: tracks[i.name] for i in sensors if i.name in tracks}
    truth = truth_of(scene, sensors, own)
    if seconds is None:
        seconds = _until_gone_by(truth, source)
    _check_rates(sensors, seconds, source)
    notes = (*drawn_values(uncertain, scene), *truth.notes)
    return Listening(scene, sensors, skipped, seconds, truth, notes, noise_key, own)


def _sampling_sensors(
    scene: Scene, source: str, tracks: Mapping[str, Track]
) -> tuple[tuple[Sensor, ...], dict[str, str]]:
    """Return the sensors that record samples, and the reason why others do not."""
    sampling = sampling_kinds()
    skipped = {
        sensor.name: f"kind {sensor.kind} writes no samples over time"
        if sensor.kind
        else "it has no kind"
        for sensor in scene.sensors
        if sensor.kind not in sampling
    }
    found = tuple(sensor for sensor in scene.sensors if sensor.name not in skipped)
    got = [f"sensor {name!r}: {why}" for name, why in skipped.items()] or ["no sensor"]
    expected = f"at least one [[sensor]] of kind {', '.join(sampling)}"
    require(found, source, expected, got[0])
    for sensor in found:
        if sensor.name in tracks:
            continue
        where = f"{source}: [[sensor]] {sensor.name!r}"
        expected = f"a flight of the {sensor.mount} that carries it (jblast world)"
        require(not sensor.mount, f"{where} mount", expected, "none")
        is_placed = np.isfinite(sensor.position_m).all()
        require(is_placed, where, "position_m = [east, north, up]", "none")
    return found, skipped


def _check_rates(sensors: tuple[Sensor, ...], seconds: float, source: str) -> None:
    """Reject rates with fractions of a hertz and sizes beyond a sound file's limits."""
    for sensor in sensors:
        rate = (sensor.instrument or Instrument()).rate
        where = f"{source}: [[sensor]] {sensor.name!r} rate_hz"
        # a WAV header has an integer rate
        fits = SENSOR_KINDS[sensor.kind].file != ".wav" or rate == round(rate)
        expected = "a whole number, as sound files require"
        require(fits, where, expected, f"{rate:g}")
        require(
            1 <= seconds * rate <= MOST_SAMPLES,
            argument("seconds"),
            f"1 to {MOST_SAMPLES:,} samples at {rate:g} Hz for sensor {sensor.name!r}",
            f"{seconds:g} s",
        )


def _until_gone_by(truth: Truth, source: str) -> float:
    """Return the time until every blast has passed every sensor [s]."""
    values = truth.values
    after = np.maximum(DURATIONS * values["positive_duration_s"], TAIL_S)
    ends = [values[name] + after for name in ("air_arrival_s", "ground_arrival_s")]
    ends = np.concatenate([end[np.isfinite(end)] for end in ends])
    last = float(ends.max(initial=-math.inf))
    if last <= 0.0:  # no blast arrives, or all did before the clock began
        return WITHOUT_BLAST_S
    # usually a `time_s` on another clock than the sensors'
    require(
        last <= LONGEST_S,
        source,
        f"{argument('seconds')}, or a charge's time_s that ends the record within "
        f"{LONGEST_S:g} s",
        f"a last blast that has passed at {last:.6g} s on the clocks",
    )
    # rounded up to a tenth of a second, so that file lengths are plain
    return math.ceil(10.0 * last) / 10.0


def packets(
    listening: Listening, sensor: Sensor, packets_hz: float | None = None
) -> Iterator[Float[np.ndarray, "sample component"]]:
    """Yield the samples of a sensor's record, in the unit of its kind.

    Args:
        listening: Plan of the records.
        sensor: One of its sensors.
        packets_hz: Packets per second; None yields all samples at once.

    Raises:
        InputError: A packet would hold no sample.
    """
    # noise depends on the sensor's position in the scene, not on the order of recording
    number = [other.name for other in listening.sensors].index(sensor.name)
    key = jax.random.fold_in(listening.key, number)
    laws, track = listening.truth.laws, listening.tracks.get(sensor.name)
    made = recording(listening.scene, sensor, key, laws=laws, track=track)
    left = max(1, round(listening.seconds * made.rate))
    if packets_hz is None:
        found: Iterable[Any] = [made.samples(listening.seconds)]
    else:
        found = made.packets(packets_hz)
    for packet in found:
        # the last packet is cut at the end of the record; a column per component
        samples = np.asarray(packet).reshape(len(packet), -1)[:left]
        yield samples
        left -= len(samples)
        if left <= 0:
            return


def truth_of(
    scene: Scene,
    sensors: tuple[Sensor, ...],
    tracks: Mapping[str, Track] | None = None,
    requested: Sequence[str] = QUANTITIES,
) -> Truth:
    """Return the true values of some of a scene's sensors.

    Args:
        scene: Scene with its numbers drawn.
        sensors: Sensors, each with a position or a track.
        tracks: Positions over time of moving sensors, by name.
        requested: Quantities.

    Raises:
        InputError: The scene names a law that does not predict its quantity.
    """
    tracks = tracks or {}
    quantities = tuple(name for name in requested if names_for(name))
    # a position is needed for the choice of laws; the arrivals refine it below
    start = [
        tracks[i.name].position[0] if i.name in tracks else i.position_m
        for i in sensors
    ]
    places = np.tile(np.stack(start), (len(scene.charges), len(quantities), 1, 1))
    layout = _layout(quantities, sensors, places)
    laws = law_names(resolve_laws(scene, layout)) | _laws_of_readings(scene)
    laws = {name: laws[name] for name in quantities}
    for n, sensor in enumerate(sensors):
        if track := tracks.get(sensor.name):
            met = places_met(scene, track, record_laws(scene, laws))
            for k, quantity in enumerate(quantities):
                places[:, k, n] = met[_arrival_of(quantity)]
    layout = _layout(quantities, sensors, places)
    # Charges are evaluated one by one: their rows have one shape, so that all share the
    # compiled program of `_recorded`.
    read = [
        _recorded(
            replace(scene, charges=(replace(charge, name=""),)),
            _layout(quantities, sensors, own[None]),
            laws,
        )
        for charge, own in zip(scene.charges, places, strict=True)
    ]
    shape = len(quantities), len(sensors)
    value, valid = (
        np.stack([np.reshape(x, shape) for x in column], axis=-1)
        for column in ([one.value for one in read], [one.valid for one in read])
    )
    return Truth(
        values=dict(zip(quantities, value, strict=True)),
        valid=dict(zip(quantities, valid, strict=True)),
        shots=tuple(charge.name for charge in scene.charges),
        laws=laws,
        notes=tuple(
            f"note: {note}"
            for shot in range(len(scene.charges))
            for note in height_notes(scene, layout, shot)
        ),
        places=dict(zip(quantities, places.transpose(1, 2, 0, 3), strict=True)),
    )


def _layout(
    quantities: Sequence[str],
    sensors: Sequence[Sensor],
    places: Float[np.ndarray, "shot quantity sensor 3"],
) -> Layout:
    """Return the rows of all charges, quantities and sensors."""
    rows = list(product(range(len(places)), quantities, sensors))
    nothing = jnp.full(len(rows), jnp.nan)
    return Layout(
        quantity=tuple(quantity for _, quantity, _ in rows),
        position=jnp.asarray(places.reshape(-1, 3)),
        slant_range=nothing,
        time=nothing,
        group=tuple(range(len(rows))),
        shot=tuple(shot for shot, *_ in rows),
        clock=tuple(sensor.name for *_, sensor in rows),
    )


def _arrival_of(quantity: str) -> str:
    """Return the arrival of the wave that has a quantity."""
    if quantity == "flash_time_s":
        return quantity
    return "ground_arrival_s" if quantity.startswith("ground_") else "air_arrival_s"


@kept
def _recorded(scene: Scene, layout: Layout, laws: dict[str, str]) -> Recording:
    return record(scene, layout, laws)


def _laws_of_readings(scene: Scene) -> dict[str, str]:
    """Return the laws that `simulate` uses for the readings of the sensors."""
    try:
        layout, sigma, _ = planned_layout(scene)
    except InputError:  # no sensor has readings: all record samples only
        return {}
    return law_names(resolve_laws(scene, layout, np.asarray(sigma)))


def with_ambient(
    uncertain: UncertainScene, file: str | None = None
) -> tuple[UncertainScene, list[str]]:
    """Return a scene with its ambient recording read, and notes on it.

    Args:
        uncertain: The scene. Its [ambient] may name a recording.
        file: Recording that replaces the scene's; a sample of 1 is `full_scale_pa` of
            [ambient].

    Raises:
        InputError: The file cannot be used (see `read_sound`).
    """
    ambient = uncertain.scene.ambient
    if file is not None:
        stated = ambient or Ambient()
        ambient = Ambient(file=file, height=stated.height, full_scale=stated.full_scale)
    if ambient is None or not ambient.file:
        return uncertain, []
    sound = read_sound(ambient.file)
    count = sound.samples.shape[1]
    require(count >= 2, str(ambient.file), "two or more samples", f"{count}")
    notes = [f"ambient sound: a loop of {ambient.file}, {count / sound.rate_hz:g} s"]
    notes += [f"ambient sound: {note}" for note in sound.notes]
    if len(sound.samples) > 1:
        notes.append(f"the first of its {len(sound.samples)} channels is used")
    if not sound.samples[0].any():
        notes.append("the ambient recording is silent")
    loop = ambient.full_scale * jnp.asarray(sound.samples[0])
    ambient = replace(ambient, loop=loop, loop_rate=float(sound.rate_hz))
    return replace(uncertain, scene=replace(uncertain.scene, ambient=ambient)), notes
