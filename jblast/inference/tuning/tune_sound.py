"""A scene tuned to the sound record of one of its sensors.

The record is read from a file and compared with the scene: sampling rate, length,
limit. The blast is located in it by the matched filter for the noise of the scene, and
the numbers are found by Whittle's likelihood (`sound`). Goodness of fit is
tested in frequency (chi squared of the deviances of the bands), in time
(Ljung-Box test of the whitened residual) and at the blast (chi squared of the whitened
residual there).
"""

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float
from scipy.special import chdtrc

from jblast.errors import InputError, argument, nearest
from jblast.inference.tuning.result import (
    TO_MEDIAN,
    Explained,
    NothingHeardError,
    Tuned,
    answer,
)
from jblast.inference.tuning.search import problem_from, solve
from jblast.inference.tuning.sound import SoundEvidence, over, sound_evidence
from jblast.inference.tuning.unknowns import (
    filled,
    tuned_value,
    unknowns_of,
    with_tuned,
)
from jblast.observations.records.formats import Scaling, open_record
from jblast.parameters import CLOCK_OFFSET
from jblast.results import warning
from jblast.scene import Instrument, Scene, UncertainScene
from jblast.scene.sensor_kinds import SENSOR_KINDS, hears_ambient
from jblast.sensors.listening import Truth, truth_of
from jblast.waves.height_of_burst import grounded

DETECTED = 6.0
"""Smallest signal of a detected blast, in standard deviations of noise: among a million
lags noise reaches 5."""
DURATIONS = 8.0
"""Length of a blast in positive phase durations: positive phase and suction."""
FIRST_POSITION = 0.3
"""Relative position in the record of a blast of unknown time, from which it is
searched: the whole blast is then inside."""
PULSE_QUANTITIES = ("air_arrival_s", "peak_overpressure_pa", "positive_duration_s")
"""Quantities whose laws determine a record of sound."""
# 257 Fourier coefficients: some 20 bands of `sound.MIN_COEFFICIENTS`
MIN_SAMPLES = 512
MAX_SAMPLES = 2**23
"""Three minutes at 48 kHz: half a gigabyte for each unknown."""
LAGS = 20
"""Largest lag [samples] at which residuals are tested for correlation (Ljung-Box)."""


class RecordedSound(NamedTuple):
    """A record and its sensor.

    Attributes:
        source: Name of the file.
        samples: Samples in the unit of the file.
        sensor: Index of the sensor in the scene.
        pascals: Pressure of a sample of 1 [Pa]; None for the sensor's full scale.
        notes: Remarks of the reader.
    """

    source: str
    samples: Float[np.ndarray, " sample"]
    sensor: int
    pascals: float | None
    notes: tuple[str, ...]


def tune_sound(
    uncertain: UncertainScene, recorded: RecordedSound, names: Sequence[str]
) -> Tuned:
    """Tune a scene to a sound record.

    Args:
        uncertain: The scene; its free numbers and those with a prior are tuned as well.
        recorded: Record of one of its sensors.
        names: Further numbers to tune.

    Raises:
        InputError: A name is unknown, there is nothing to tune, or no explosion.
        NothingHeardError: The time is free, and no blast stands out of the noise.
    """
    index = recorded.sensor
    own = uncertain.scene.sensors[index]
    rate = (own.instrument or Instrument()).rate
    notes = [warning("remark", text=text) for text in recorded.notes]
    # Whittle's likelihood divides by the spectrum of the noise: a scene without any
    # noise has no likelihood, so the noise of the sensor is tuned as well
    has_noise = not {"noise_pa", "ambient_level_pa"}.isdisjoint(names)
    is_silent = not has_noise and _is_silent(uncertain.scene, index)
    if is_silent and (names or uncertain.beliefs):
        names = [*names, "noise_pa"]
        notes.append(warning("noise_added"))
    scene, unknowns = unknowns_of(uncertain, names, "sound", rate)
    scene = filled(scene, index, names, _loudness(scene, recorded))
    truth = truth_of(scene, (scene.sensors[index],))
    scene = grounded(scene)
    limit = _limit(scene, recorded, names)
    evidence = sound_evidence(
        recorded.samples, index, truth.laws, recorded.pascals, limit
    )
    # the wave form has no slope towards a blast that does not overlap it in time: a
    # free time is set by the matched filter before the search
    free = [one.name for one in unknowns]
    times = [n for n in (f"{CLOCK_OFFSET}.{own.name}", "origin_time_s") if n in free]
    if times:
        scene, truth = _timed(evidence, scene, truth, times[0], recorded.source)
    problem = problem_from(evidence, scene, unknowns)
    found = solve(problem)
    tuned = problem.scene_at(jnp.asarray(found.z))
    # laws and blast window at the result, which may have moved
    truth = truth_of(tuned, (tuned.sensors[index],))
    blast = _blast(truth, rate, recorded.samples.size)
    if blast is None:
        notes.append(warning("blast_outside", seconds=recorded.samples.size / rate))
    wrong = [name for name, held in truth.valid.items() if not held.all()]
    if invalid := [name for name in wrong if name in PULSE_QUANTITIES]:
        notes.append(warning("law_invalid", quantities=invalid))
    explained = explained_sound(evidence, tuned, len(unknowns), blast)
    return answer(problem, found, "sound", explained, notes)


def _loudness(scene: Scene, recorded: RecordedSound) -> float:
    """Return the rms of the record's noise, by its median magnitude [Pa]."""
    unit = recorded.pascals
    if unit is None:
        instrument = scene.sensors[recorded.sensor].instrument
        assert instrument is not None
        assert instrument.full_scale is not None
        unit = float(np.asarray(instrument.full_scale))
    # without the offset of the recorder
    samples = recorded.samples - np.median(recorded.samples)
    typical = float(np.median(np.abs(samples))) / TO_MEDIAN
    # a record of mostly zeros (a simulated one) has a median of 0
    return unit * max(typical, 1e-6 * float(np.abs(samples).max()))


def _limit(scene: Scene, recorded: RecordedSound, names: Sequence[str]) -> float:
    """Return the magnitude above which samples are at the recorder's limit.

    If the limit itself is tuned by a record in pascals, clipped samples are used, since
    they identify it.
    """
    instrument = scene.sensors[recorded.sensor].instrument
    assert instrument is not None
    full_scale, pascals = instrument.full_scale, recorded.pascals
    if full_scale is None or instrument.saturation != "clip":
        return math.inf
    if pascals is not None and "full_scale_pa" in names:
        return math.inf
    step = 0.0 if instrument.bits is None else 2.0 ** (1 - instrument.bits)
    # one and a half steps below full scale: the largest code may be one step short of
    # it
    share = 1.0 - 1.5 * step - 1e-6
    return share * (1.0 if pascals is None else float(full_scale) / pascals)


def _is_silent(scene: Scene, index: int) -> bool:
    """Return True if a scene has no noise of any kind for a sensor."""
    sensor, ambient = scene.sensors[index], scene.ambient
    instrument = sensor.instrument or Instrument()
    own = instrument.noise is not None and float(instrument.noise) > 0
    written = instrument.bits is not None
    around = (
        hears_ambient(sensor.kind)
        and ambient is not None
        and ambient.loop is None
        and float(ambient.level) > 0
    )
    return not (own or written or around or instrument.wind_noise is not None)


def _timed(
    evidence: SoundEvidence, scene: Scene, truth: Truth, name: str, source: str
) -> tuple[Scene, Truth]:
    """Return a scene with the blast at its time in the record."""
    index = evidence.index
    sensor = scene.sensors[index]
    rate = (sensor.instrument or Instrument()).rate
    arrival = float(np.nanmin(truth.values["air_arrival_s"]))
    seconds = evidence.samples.size / rate
    shift = 0.0
    # a blast outside of the record, or cut off at its end, has no matched filter
    if not 0.0 < arrival < 0.8 * seconds:
        shift = FIRST_POSITION * seconds - arrival
    scene = _shifted(scene, index, name, shift)
    lag, snr = best_lag(evidence, scene)
    if not float(snr) > DETECTED:
        raise NothingHeardError(
            f"{source}: no blast stands out of the noise: expected a signal of "
            f"{DETECTED:g} standard deviations, got {float(snr):.2g} at the most "
            "probable time"
        )
    scene = _shifted(scene, index, name, float(lag) / rate)
    return scene, truth_of(scene, (scene.sensors[index],))


def _shifted(scene: Scene, index: int, name: str, shift: float) -> Scene:
    """Return a scene with a later arrival of the blast at a sensor [s]."""
    held = tuned_value(scene, index, name)
    assert held is not None
    return with_tuned(scene, index, {name: held + shift})


def _blast(truth: Truth, rate: float, count: int) -> tuple[int, int] | None:
    """Return the first sample of the blast, and the one after its last."""
    arrivals = [truth.values["air_arrival_s"], truth.values["ground_arrival_s"]]
    first = np.concatenate([np.ravel(one) for one in arrivals])
    last = truth.values["air_arrival_s"]
    last = last + DURATIONS * truth.values["positive_duration_s"]
    first, last = first[np.isfinite(first)], last[np.isfinite(last)]
    if not (first.size and last.size):
        return None
    begin = int(np.clip(first.min() * rate, 0, count))
    end = int(np.clip(last.max() * rate, 0, count))
    return (begin, end) if end > begin else None


def recorded_sound(
    path: str | os.PathLike[str],
    scene: Scene,
    source: str,
    sensor: str | None = None,
    full_scale_pa: float | None = None,
) -> RecordedSound:
    """Read the record of a microphone or pressure gauge of a scene.

    Args:
        path: The file.
        scene: The scene.
        source: Name of the scene's file, for messages.
        sensor: Name of the sensor; None for the one that the file is named after, or
            the only one.
        full_scale_pa: Pressure of a sample of 1 [Pa]; None for 1 Pa (floats) or the
            sensor's full scale (integers).

    Raises:
        InputError: The file cannot be read, is constant, or has another sampling rate
            than the sensor; or its sensor or its scale is not specified.
    """
    index = _index(Path(path), scene, source, sensor)
    own = scene.sensors[index]
    instrument = own.instrument or Instrument()
    label = f"sensor {own.name!r}"
    recordings = open_record(path, Scaling(full_scale_pa))
    count = sum(len(one.names) for one in recordings)
    if count > 1:
        raise InputError(
            f"{path}: expected the one channel of {label}, got {count}; write it into "
            "a separate file"
        )
    (recording,) = recordings
    # files store the rate as a float of 32 bits, or as a rounded interval
    if abs(recording.rate_hz - instrument.rate) > 1e-6 * instrument.rate:
        raise InputError(
            f"{path}: expected {instrument.rate:g} samples a second, the rate_hz of "
            f"{label} in {source}, got {recording.rate_hz:g}"
        )
    if not MIN_SAMPLES <= recording.length <= MAX_SAMPLES:
        raise InputError(
            f"{path}: expected {MIN_SAMPLES:,} to {MAX_SAMPLES:,} samples, got "
            f"{recording.length:,}"
        )
    samples = recording.samples(0, recording.length)[0]
    if not np.ptp(samples) > 0:
        raise InputError(
            f"{path}: expected a record of sound, got {samples[0]:g} throughout"
        )
    pascals: float | None = 1.0
    if recording.full_scale is not None and full_scale_pa is None:
        if instrument.full_scale is None:
            raise InputError(
                f"{path}: got integers; expected {argument('full_scale')}, the "
                "pressure of a sample of 1 in pascals, or full_scale_pa of "
                f"{label} in {source}"
            )
        pascals = None
    return RecordedSound(str(path), samples, index, pascals, recording.notes)


def _index(path: Path, scene: Scene, source: str, sensor: str | None) -> int:
    """Return the index of the sensor that recorded a file."""
    tuned = [name for name, kind in SENSOR_KINDS.items() if kind.is_tuned]
    kinds = " or ".join(tuned)
    heard = [index for index, one in enumerate(scene.sensors) if one.kind in tuned]
    names = [scene.sensors[index].name for index in heard]
    if not heard:
        raise InputError(f"{source}: expected a [[sensor]] of kind {kinds}, got none")
    if sensor is not None:
        if sensor not in names:
            kind_of = {one.name: one.kind or "not stated" for one in scene.sensors}
            got = f"got {sensor!r}{nearest(sensor, names)}"
            if kind := kind_of.get(sensor):
                got = f"which record sound, got {sensor!r}, whose kind is {kind}"
            known = f"one of {', '.join(names)} in {source}"
            raise InputError(f"{argument('sensor')}: expected {known}, {got}")
        index = heard[names.index(sensor)]
    elif path.stem in names:
        index = heard[names.index(path.stem)]
    elif len(heard) == 1:
        index = heard[0]
    else:
        raise InputError(
            f"{path}: expected {argument('sensor')}, which of {', '.join(names)} in "
            f"{source} recorded it; got none, and no file of a sensor's name"
        )
    own = scene.sensors[index]
    if own.mount or not np.isfinite(np.asarray(own.position_m)).all():
        raise InputError(
            f"{source}: [[sensor]] {own.name!r}: expected position_m of a sensor at "
            f"rest, got {'a mount' if own.mount else 'nothing'}"
        )
    return index


def explained_sound(
    evidence: SoundEvidence,
    scene: Scene,
    unknowns: int,
    blast: tuple[int, int] | None,
) -> Explained:
    """Return the goodness of fit of a scene to a record.

    Args:
        evidence: The record.
        scene: The tuned scene.
        unknowns: Number of tuned numbers.
        blast: First sample of the blast, and the one after its last; None if it is not
            in the record.
    """
    deviance, white = _left(evidence, scene)
    deviance, white = np.asarray(deviance), np.asarray(white)
    # every unknown may absorb one band
    dof = max(deviance.size - unknowns, 1)
    total = float(np.square(deviance).sum())
    tests = {"spectrum": float(chdtrc(dof, total))}
    # zeros are the tapered ends
    inside = white[white != 0.0]
    tests["whiteness"] = whiteness(inside)
    if blast is not None:
        there = white[slice(*blast)]
        there = there[there != 0.0]
        if there.size:
            energy = float(np.square(there).sum())
            tests["blast"] = float(chdtrc(there.size, energy))
    sum_of_squares = float(np.square(inside).sum())
    return Explained(sum_of_squares, int(inside.size), tests)


def whiteness(white: Float[np.ndarray, " sample"]) -> float:
    """Return the p-value of the Ljung-Box test of uncorrelated samples."""
    n, energy = white.size, float(np.square(white).sum())
    # a short record has no precise correlation at large lags
    lags = np.arange(1, min(LAGS, n // 4) + 1)
    likeness = np.array([white[lag:] @ white[:-lag] for lag in lags]) / energy
    q = n * (n + 2) * float((np.square(likeness) / (n - lags)).sum())
    return float(chdtrc(lags.size, q))


@eqx.filter_jit
def _left(
    evidence: SoundEvidence, scene: Scene
) -> tuple[Float[Array, " band"], Float[Array, " sample"]]:
    weights = evidence.weights(scene)
    return evidence.deviance(scene, weights), evidence.time_residuals(scene)


@eqx.filter_jit
def best_lag(
    evidence: SoundEvidence, scene: Scene
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return the delay of a blast in a record relative to a scene, and its SNR.

    The delay [samples] is that of the largest output of the matched filter for the
    noise of the scene; it is circular. The SNR is that output in standard deviations of
    noise.
    """
    n = evidence.samples.size
    sd = evidence.weights(scene).sd
    expected = over(jnp.fft.rfft(evidence.predicted(scene)), sd)
    record = over(jnp.fft.rfft(evidence.samples), sd)
    match = jnp.fft.irfft(jnp.conj(expected) * record, n)
    lag = jnp.argmax(match)
    power = jnp.square(expected.real) + jnp.square(expected.imag)
    energy = jnp.fft.irfft(lax.complex(power, jnp.zeros_like(power)), n)[0]
    snr = match[lag] * jnp.sqrt(2.0 * n / energy) / jnp.sqrt(2.0)
    # the correlation is circular: lags beyond half the record are negative
    return jnp.where(lag > n // 2, lag - n, lag).astype(float), snr
