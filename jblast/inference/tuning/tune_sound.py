"""A scene tuned to what one of its sensors heard."""

import math
from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from jblast.errors import InputError
from jblast.inference.tuning.answer import answer
from jblast.inference.tuning.explained_sound import best_lag, explained_sound
from jblast.inference.tuning.notes import Note
from jblast.inference.tuning.recorded_sound import RecordedSound
from jblast.inference.tuning.result import NothingHeardError, Tuned
from jblast.inference.tuning.search.solve import problem_from, solve
from jblast.inference.tuning.sound import SoundEvidence, sound_evidence
from jblast.inference.tuning.unknowns import (
    filled,
    tuned_value,
    unknowns_of,
    with_tuned,
)
from jblast.parameters import CLOCK_OFFSET
from jblast.scene import Instrument, Scene, UncertainScene
from jblast.sensors.listening import Truth, truth_of
from jblast.sensors.wave_paths import low_charges_settled

HEARD = 6.0
"""Standard deviations of noise from which on a blast that is looked for is heard."""
TO_MEDIAN = 0.6745
"""Median magnitude of a standard normal number."""
DURATIONS = 8.0
"""Of the positive phase, until a blast has gone by."""
AIMED_AT = 0.3
"""Part of a record where a blast is put first whose time is not known."""


def tune_sound(
    uncertain: UncertainScene, recorded: RecordedSound, names: Sequence[str]
) -> Tuned:
    """Return what a sound record tells of a scene.

    Args:
        uncertain: The scene; what it leaves free, or gives a prior, is looked for, too.
        recorded: What one of its sensors recorded.
        names: What else is looked for.

    Raises:
        InputError: A name is none, nothing is looked for, or nothing explodes.
        NothingHeardError: The time is looked for, and no blast stands out of the noise.
    """
    source, index = uncertain.source or "scene", recorded.sensor
    charges = uncertain.scene.charges
    if all(bool(np.asarray(charge.never)) for charge in charges):
        raise InputError(
            f"{source}: [charge] time_s: expected a blast, got one that never happens"
        )
    if any(charge.range_m is not None for charge in charges):
        raise InputError(
            f"{source}: [charge] range_m: expected position_m, from which sound comes, "
            "got a distance alone"
        )
    own = uncertain.scene.sensors[index]
    rate = (own.instrument or Instrument()).rate
    notes = [Note("reading", {"text": text}) for text in recorded.notes]
    uncertain, unknowns = unknowns_of(uncertain, names, "sound", rate)
    if not unknowns:
        raise InputError(f"{source}: expected something to tune, got nothing free")
    loudness = _loudness(uncertain.scene, recorded)
    if _is_silent(uncertain.scene, index) and not _tells_noise(names):
        names = [*names, "noise_pa"]
        notes.append(Note("noise_added", {}))
        _, extra = unknowns_of(uncertain, ["noise_pa"], "sound", rate)
        unknowns = (*unknowns, extra[-1])
    scene = filled(uncertain.scene, index, names, loudness)
    scene, truth = truth_of(scene, (scene.sensors[index],))
    scene = low_charges_settled(scene)
    limit = _limit(scene, recorded, names)
    evidence = sound_evidence(
        recorded.samples, index, truth.laws, recorded.pascals, limit
    )
    free = [one.name for one in unknowns]
    clock = f"{CLOCK_OFFSET}.{own.name}"
    timing = next((name for name in (clock, "origin_time_s") if name in free), None)
    if timing is not None:
        scene, truth = _timed(evidence, scene, truth, timing, recorded.source)
    problem = problem_from(evidence, scene, unknowns)
    found = solve(problem)
    tuned = problem.scene_at(jnp.asarray(found.z))
    _, truth = truth_of(tuned, (tuned.sensors[index],))
    blast = _blast(truth, rate, recorded.samples.size)
    if blast is None:
        notes.append(Note("blast_outside", {"seconds": recorded.samples.size / rate}))
    wrong = [name for name, held in truth.valid.items() if not held.all()]
    if heard := [name for name in wrong if name in HEARD_BY]:
        notes.append(Note("law_invalid", {"quantities": heard}))
    explained = explained_sound(evidence, tuned, len(unknowns), blast)
    return answer(problem, found, "sound", explained, notes)


HEARD_BY = ("air_arrival_s", "peak_overpressure_pa", "positive_duration_s")
"""What a record of sound is made from."""


def _loudness(scene: Scene, recorded: RecordedSound) -> float:
    """Return the record's rms without what is short and loud [Pa]."""
    unit = recorded.pascals
    if unit is None:
        instrument = scene.sensors[recorded.sensor].instrument
        assert instrument is not None
        assert instrument.full_scale is not None
        unit = float(np.asarray(instrument.full_scale))
    samples = recorded.samples - np.median(recorded.samples)
    typical = float(np.median(np.abs(samples))) / TO_MEDIAN
    return unit * max(typical, 1e-6 * float(np.abs(samples).max()))


def _limit(scene: Scene, recorded: RecordedSound, names: Sequence[str]) -> float:
    """Return from which magnitude on samples are at the recorder's limit.

    Where a record in pascals is to tell the limit, they are what it tells it by.
    """
    instrument = scene.sensors[recorded.sensor].instrument
    assert instrument is not None
    full_scale, pascals = instrument.full_scale, recorded.pascals
    if full_scale is None or instrument.saturation != "clip":
        return math.inf
    if pascals is not None and "full_scale_pa" in names:
        return math.inf
    step = 0.0 if instrument.bits is None else 2.0 ** (1 - instrument.bits)
    share = 1.0 - 1.5 * step - 1e-6
    return share * (1.0 if pascals is None else float(full_scale) / pascals)


def _is_silent(scene: Scene, index: int) -> bool:
    """Whether a scene has no noise of any kind for a sensor."""
    sensor, ambient = scene.sensors[index], scene.ambient
    instrument = sensor.instrument or Instrument()
    own = instrument.noise is not None and float(instrument.noise) > 0
    written = instrument.bits is not None
    around = (
        sensor.kind != "pressure"
        and ambient is not None
        and ambient.loop is None
        and float(ambient.level) > 0
    )
    return not (own or written or around or instrument.wind_noise is not None)


def _tells_noise(names: Sequence[str]) -> bool:
    return any(name in ("noise_pa", "ambient_level_pa") for name in names)


def _timed(
    evidence: SoundEvidence, scene: Scene, truth: Truth, name: str, source: str
) -> tuple[Scene, Truth]:
    """Return a scene whose blast comes when the record has one."""
    index = evidence.index
    sensor = scene.sensors[index]
    rate = (sensor.instrument or Instrument()).rate
    arrival = float(np.nanmin(truth.values["air_arrival_s"]))
    seconds = evidence.samples.size / rate
    shift = 0.0
    if not 0.0 < arrival < 0.8 * seconds:
        shift = AIMED_AT * seconds - arrival
    scene = _shifted(scene, index, name, shift)
    lag, snr = best_lag(evidence, scene)
    if not float(snr) > HEARD:
        raise NothingHeardError(
            f"{source}: no blast stands out of the noise: the likeliest place for the "
            f"scene's has a signal of {float(snr):.2g} standard deviations, {HEARD:g} "
            "are needed"
        )
    scene = _shifted(scene, index, name, float(lag) / rate)
    return scene, truth_of(scene, (scene.sensors[index],))[1]


def _shifted(scene: Scene, index: int, name: str, shift: float) -> Scene:
    """Return a scene of which a sensor hears the blast later [s]."""
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
