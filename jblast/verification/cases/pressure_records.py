"""Logs of simulated pressure records: pulses by the laws, sampled with noise and drift.

A surface charge of 15 kg, gauges 8 to 40 m away. Known is where and when it was; asked
for is its mass.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference.picks import RecordPick
from jblast.inference.posterior.parameters import parameters_of
from jblast.inference.records.covariance import TOLD, covariance_of, log_value
from jblast.observations import Observations, observed
from jblast.observations.records.recording import PressureRecord
from jblast.scene import Charge, Scene, UncertainScene, freed, with_laws
from jblast.sensors import Layout, record
from jblast.waves.pulse import pulse_mean, pulse_of

MASS = 15.0
RANGES = (8.0, 11.0, 15.0, 20.0, 28.0, 40.0)
LAWS = dict.fromkeys(TOLD, "kingery_bulmash")
BEFORE, BEHIND = 1.0, 6.0
"""A record begins so many durations before its front, and ends behind it."""
SETTLES = 64
"""Samples after which coloured noise has forgotten how it began."""
SUCTION, SUCTION_IMPULSE = 0.2, 0.6
"""Shares of peak and impulse, about those of the laws."""


@dataclass(frozen=True)
class Recorder:
    """How records are taken.

    Attributes:
        snr: Peak over the noise of a sample.
        samples: Of a record.
        rise: Time of rise [samples].
        colour: Share of the noise of a sample that the next one has.
        drift: Of the baseline over the record, share of the peak.
        wander: Of the baseline to and fro, share of the peak either way.
        wander_period: Of that, in durations.
        full_scale: At which it clips, share of the peak; None: nowhere.
        echo: Arrival of a second wave, in durations behind the first; None: none.
        echo_size: Its peak over that of the first.
        echo_rise: Its time of rise [samples]; None: that of the first.
        before: Durations before the front that a record begins.
    """

    snr: float = 20.0
    samples: int = 1024
    rise: float = 2.0
    colour: float = 0.0
    drift: float = 0.0
    wander: float = 0.0
    wander_period: float = 4.0
    full_scale: float | None = None
    echo: float | None = None
    echo_size: float = 0.3
    echo_rise: float | None = None
    before: float = BEFORE


def uncertain_scene(*, scatter: bool) -> UncertainScene:
    """Return what is known before: all but the mass; the laws scatter, or are exact."""
    scene = Scene(Charge(mass_kg=MASS), scatter=scatter)
    return with_laws(freed(UncertainScene(scene), ["charge_mass_kg"]), LAWS)


def layout() -> Layout:
    """Return the rows that picks of all gauges fill, gauge by gauge."""
    count = len(RANGES)
    return Layout(
        quantity=TOLD * count,
        position=jnp.zeros((4 * count, 3)),
        slant_range=jnp.repeat(jnp.asarray(RANGES), 4),
        time=jnp.full(4 * count, jnp.nan),
        group=tuple(gauge for gauge in range(count) for _ in TOLD),
        shot=(0,) * (4 * count),
        clock=("",) * (4 * count),
    )


def readings(
    rng: np.random.Generator, *, scatter: bool
) -> Float[np.ndarray, "gauge asked"]:
    """Draw what pulses have at the gauges, laws' scatter included, in their units."""
    uncertain = uncertain_scene(scatter=scatter)
    recording = record(parameters_of(uncertain).scene, layout(), LAWS)
    value = np.asarray(recording.value).reshape(-1, 4)
    own = np.asarray(recording.record_sd).reshape(-1, 4)
    error = own * rng.standard_normal(own.shape)
    for each in recording.shot_loading.values():
        error += np.asarray(each).reshape(-1, 4) * rng.standard_normal()
    for each in recording.path_loading.values():
        path = rng.standard_normal((len(RANGES), 1))
        error += np.asarray(each).reshape(-1, 4) * path
    moved = value * np.exp(error)
    moved[:, 0] = value[:, 0] + error[:, 0]
    return moved


def recorded(
    rng: np.random.Generator,
    values: Float[np.ndarray, "gauge asked"],
    recorder: Recorder,
) -> list[PressureRecord]:
    """Return the records of pulses of some arrivals, peaks, durations and impulses."""
    found = []
    for gauge, asked in enumerate(values.tolist()):
        arrival, peak, duration, _ = asked
        step = (recorder.before + BEHIND) * duration / recorder.samples
        start = arrival - (recorder.before + 0.01 * rng.uniform()) * duration
        edges = (np.arange(recorder.samples + 1) - 0.5) * step + start
        rise = recorder.rise * step
        samples = _wave(asked, rise, edges)
        if recorder.echo is not None:
            later = [arrival + recorder.echo * duration, *asked[1:]]
            slow = rise if recorder.echo_rise is None else recorder.echo_rise * step
            samples = samples + recorder.echo_size * _wave(later, slow, edges)
        samples = samples + _noise(rng, recorder) * peak / recorder.snr
        run = np.linspace(-0.5, 0.5, recorder.samples)
        samples = samples + recorder.drift * peak * run
        if recorder.wander:
            turns = recorder.samples * step / (recorder.wander_period * duration)
            phase = 2.0 * np.pi * (turns * run + rng.uniform())
            samples = samples + recorder.wander * peak * np.cos(phase)
        level = None
        if recorder.full_scale is not None:
            level = recorder.full_scale * peak
            samples = np.clip(samples, -level, level)
        found.append(
            PressureRecord(
                f"g{gauge}", samples, 1.0 / step, start_s=start, full_scale=level
            )
        )
    return found


def _wave(asked: Sequence[float], rise: float, edges: Float[np.ndarray, " edge"]):
    """Return the means of a pulse over samples."""
    arrival, peak, duration, impulse = asked
    suction, below = SUCTION * peak, SUCTION_IMPULSE * impulse
    pulse = pulse_of(arrival, peak, impulse, duration, rise, suction, below)
    return np.asarray(pulse_mean(pulse, edges[:-1], edges[1:]))


def _noise(rng: np.random.Generator, recorder: Recorder):
    """Return noise of unit variance, each sample a share of the last."""
    white = rng.standard_normal(recorder.samples + SETTLES)
    for k in range(1, white.size if recorder.colour else 0):
        left = np.sqrt(1 - recorder.colour**2)
        white[k] = recorder.colour * white[k - 1] + left * white[k]
    return white[SETTLES:]


def log_of_picks(picks: Sequence[RecordPick]) -> Observations:
    """Return the rows of picks of all gauges, with what they share."""
    values = [log_value(one, quantity) for one in picks for quantity in TOLD]
    names = tuple(one.record.name for one in picks for _ in TOLD)
    return observed(
        names,
        TOLD * len(picks),
        [value for value, _ in values],
        [sigma for _, sigma in values],
        slant_range=np.repeat(np.array(RANGES), len(TOLD)),
        record=names,
        covariances=tuple(covariance_of(one, one.record.name, TOLD) for one in picks),
    )
