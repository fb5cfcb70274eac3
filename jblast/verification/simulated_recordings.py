"""Recordings whose truth is known: pressure records, sound in noise, and films.

Pressure records are pulses by the laws, sampled with noise and drift: a surface charge
of 15 kg, gauges 8 to 40 m away. Place and time are known; the mass is to be estimated.
A pick is far off where a reading differs from the truth by more than `OUTLIER_SD` of
its own standard deviations. Sound for detectors is noise of a known spectrum with one
pulse.

The explosion in frames is eight views, `explosion_left_out`, of the explosion that is
part of jblast, from directions drawn at random and not among those of its set, at ten
of its phases. A close-up shows such a picture as it was rendered, texel by pixel.

The moving disc has a bright edge that moves outwards. The logarithm of light is a
logistic of the distance from the edge, 1 px wide, so the radius at which a threshold is
crossed moves with the edge, and the camera events are known.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jblast.inference.posterior.parameters import parameters_of
from jblast.observations import Observations, observed
from jblast.observations.records.recording import PressureRecord
from jblast.observations.table import RECORD_QUANTITIES
from jblast.scene import (
    Camera,
    Charge,
    Scene,
    UncertainScene,
    freed,
    look_at,
    with_laws,
)
from jblast.sensors import Layout, record
from jblast.sensors.camera import (
    ExplosionViews,
    ViewSet,
    linear_to_srgb,
    luminance,
    render,
)
from jblast.sensors.camera.fireball import Appearance
from jblast.signals import NoiseSpectrum
from jblast.signals.picks import RecordPick, pick_records
from jblast.signals.picks.pick_log import covariance_of, log_value
from jblast.waves.fireball import fireball, fireball_duration
from jblast.waves.pulse import pulse_mean, pulse_of

HEIGHT, WIDTH = 48, 64
SHAPE = HEIGHT, WIDTH


# the last of the six thresholds lies at 87 % of the rise: in the flat end of the edge
# 8 bits tell little of the time (90 us if it lies at 99 %)
DARK, BRIGHT = float(np.log(50 / 255)), float(np.log(200 / 255))
EDGE, SPEED, START, DURATION = 1.0, 260.0, 3.0, 0.08
"""Width [px], speed [px/s] and first radius [px] of the edge; of the scene [s]."""
THRESHOLD = 0.2
LEFT_OUT = Path(__file__).parent / "explosion_left_out"
MASS = 15.0
CAMERA_DISTANCE_RADII = 30.0
"""Of a close-up's camera, in radii of the fireball."""
BACKGROUND = 0.18
"""Grey behind the fire, linear."""
REPEATS = 3
"""Of which the quickest counts."""
MIN_OPACITY = 0.02
"""Opacity from which a pixel is the fire's."""
RATE = 48000.0
"""Samples a second [Hz]."""
# Few logs, as each is picked and fitted; the seed fixes them.
LOGS, SEED = 5, 3
OUTLIER_SD = 4.0
"""A normal error is beyond this once in 16,000 [sd]."""
RANGES = (8.0, 11.0, 15.0, 20.0, 28.0, 40.0)
LAWS = dict.fromkeys(RECORD_QUANTITIES, "kingery_bulmash")
BEFORE, BEHIND = 1.0, 6.0
"""A record begins so many durations before its front, and ends behind it."""
SETTLES = 64
"""Samples after which coloured noise has forgotten how it began."""
SUCTION, SUCTION_IMPULSE = 0.2, 0.6
"""Shares of peak and impulse, about those of the laws."""


def radius(x: Float[Array, "..."], y: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return the distance of places from the middle of the disc [px]."""
    return jnp.hypot(x - (WIDTH - 1) / 2 - 0.3, y - (HEIGHT - 1) / 2 + 0.2)


def disc_light(
    time: Float[Array, "..."],
    x: Float[Array, "..."],
    y: Float[Array, "..."],
    start: Float[Array, ""] | float = START,
    speed: Float[Array, ""] | float = SPEED,
) -> Float[Array, "..."]:
    """Return the logarithm of light at times [s], columns and rows."""
    away = (radius(x, y) - start - speed * time) / EDGE
    return DARK + (BRIGHT - DARK) * jax.nn.sigmoid(-away)


def disc_frames(times: Float[np.ndarray, " frame"]) -> Float[np.ndarray, "frame _ _"]:
    """Return images of the logarithm of light; the disc rests from `DURATION` on."""
    return np.asarray(_frames(jnp.asarray(np.minimum(times, DURATION))))


@jax.jit
def _frames(times):
    x, y = jnp.meshgrid(*(jnp.arange(n, dtype=times.dtype) for n in (WIDTH, HEIGHT)))
    return jax.vmap(lambda time: disc_light(time, x, y))(times)


def film(
    fps: float | int,
) -> tuple[Float[np.ndarray, " frame"], Float[np.ndarray, "frame _ _"]]:
    """Return times [s], and images of the logarithm of light."""
    times = np.arange(round(DURATION * fps) + 1) / fps
    return times, disc_frames(times)


def analytic() -> tuple[
    Int[np.ndarray, " event"], Int[np.ndarray, " event"], Float[np.ndarray, " event"]
]:
    """Return pixel, number and time [s] of each event, by pixel and then time."""
    begin, end = (frame.ravel() for frame in disc_frames(np.array([0.0, DURATION])))
    number = np.floor((end - begin) / THRESHOLD).astype(int)
    pixel = np.repeat(np.arange(begin.size), number)
    nth = np.arange(1, pixel.size + 1) - np.repeat(np.cumsum(number) - number, number)
    y, x = np.divmod(pixel, WIDTH)
    share = (begin[pixel] + nth * THRESHOLD - DARK) / (BRIGHT - DARK)
    away = EDGE * np.log(1.0 / share - 1.0)
    edge = np.asarray(radius(jnp.asarray(x, float), jnp.asarray(y, float))) - away
    return pixel, nth, (edge - START) / SPEED


def passed_wholly() -> np.ndarray:
    """Return which pixels the edge has passed wholly, row by row."""
    begin, end = disc_frames(np.array([0.0, DURATION]))
    return ((begin < DARK + 1e-3) & (end > BRIGHT - 1e-3)).ravel()


class CloseUp(NamedTuple):
    """A picture of the fire alone.

    Attributes:
        grey: Luminance before an even grey, as it is looked at (sRGB), 0 to 1.
        fire: Which pixels are the fire's.
    """

    grey: Float[np.ndarray, "height width"]
    fire: Bool[np.ndarray, "height width"]


def close_up(
    views: ExplosionViews, shown: ExplosionViews, view: int, frame: int
) -> CloseUp:
    """Return what a set shows from a view's side, as large as the view's picture.

    Args:
        views: The set that is looked at.
        shown: The set that has the view.
        view: Its number.
        frame: Of the set that has the view.
    """
    time = float(shown.phase[frame]) * float(fireball_duration(MASS))
    radius = float(fireball(MASS, time).radius)
    place = CAMERA_DISTANCE_RADII * radius * np.asarray(shown.direction[view])
    size = shown.frames.shape[2]
    # the outline of a ball is seen a little larger than the ball
    focal = float(shown.radius[view, frame]) * np.sqrt(CAMERA_DISTANCE_RADII**2 - 1.0)
    camera = Camera(
        position=place,
        quaternion=look_at(place, np.zeros(3)),
        focal=np.full(2, focal),
        center=np.asarray(shown.anchor[view]),
        width=size,
        height=size,
    )
    scene = Scene(charge=Charge(mass_kg=MASS))
    (layer,) = np.asarray(
        render(scene, camera, np.array([time]), views=views, ground=False, alpha=True)
    )
    alpha = layer[..., 3:]
    light = np.clip(alpha * layer[..., :3] + (1.0 - alpha) * BACKGROUND, 0.0, 1.0)
    return CloseUp(
        luminance(np.asarray(linear_to_srgb(light))), alpha[..., 0] > MIN_OPACITY
    )


class Filmed(NamedTuple):
    """A film of one charge.

    Attributes:
        scene: 15 kg on the ground.
        camera: 40 m from it.
        times: From the burst until the fire is out [s].
        appearance: The fire lights the ground, or not.
    """

    scene: Scene
    camera: Camera
    times: Float[np.ndarray, " frame"]
    appearance: Appearance


def filmed(
    frames: int, *, width: int = 640, height: int = 480, flash: bool = True
) -> Filmed:
    """Return a film of an explosion whose fireball is 0.4 of the image's height wide.

    Args:
        frames: How many.
        width: Of the image [px].
        height: Likewise.
        flash: Whether the fire lights the ground.
    """
    place, life = np.array([0.0, -40.0, 2.0]), float(fireball_duration(MASS))
    camera = Camera(
        position=place,
        quaternion=look_at(place, np.array([0.0, 0.0, 4.0])),
        focal=np.full(2, 1.8 * height),
        center=0.5 * np.array([width - 1.0, height - 1.0]),
        width=width,
        height=height,
    )
    times = life * (np.arange(frames) + 0.5) / frames
    scene = Scene(charge=Charge(mass_kg=MASS))
    return Filmed(scene, camera, times, Appearance(flash=flash))


def processor_seconds(views: ViewSet | None, film: Filmed) -> float:
    """Return the time of processors that a frame of a film takes, all with it [s].

    Not of the clock: others may use the machine.

    Args:
        views: The set; None for the smooth ball.
        film: What is rendered.
    """

    def run() -> Array:
        return render(
            film.scene,
            film.camera,
            film.times,
            views=views,
            appearance=film.appearance,
        )

    jax.block_until_ready(run())
    best = np.inf
    for _ in range(REPEATS):
        start = time.process_time()
        jax.block_until_ready(run())
        best = min(best, time.process_time() - start)
    return best / len(film.times)


def rumble(lines: bool = False) -> NoiseSpectrum:
    """Return wind and traffic over a recorder's floor: 90 dB from end to end.

    Args:
        lines: Whether a rotor's first three harmonics, 141 Hz apart, are in it.
    """
    f = np.linspace(0.0, RATE / 2, 2049)
    density = 1 / (1 + (f / 30) ** 2) ** 1.2 + 1e-5 / (1 + (f / 500) ** 2) + 1e-9
    if lines:
        density[[12, 24, 36]] *= 100.0
    return NoiseSpectrum(f, density)


def coloured(
    rng: np.random.Generator, noise: NoiseSpectrum, size: int, rows: int = 1
) -> Float[np.ndarray, "row sample"]:
    """Draw noise around a circle of so many samples, by its spectrum alone.

    Args:
        rng: Where chance comes from.
        noise: Its spectrum.
        size: Samples of a row.
        rows: How many.
    """
    frequency = np.fft.rfftfreq(size, 1 / RATE)
    spread = np.sqrt(np.interp(frequency, *noise[:2]) * RATE / 2)
    white = np.fft.rfft(rng.standard_normal((rows, size)))
    return np.fft.irfft(white * spread, size)


def pulse(
    duration_s: float, delay: float = 0.0, rise_s: float = 2e-4
) -> Float[np.ndarray, " sample"]:
    """Return a blast of peak about 0.8 with a smooth front and a smooth end.

    Args:
        duration_s: Of all of it [s].
        delay: By so many samples it comes later, a fraction or more.
        rise_s: Of the front [s].
    """
    count = round(duration_s * RATE)
    t = (np.arange(count) - delay) / RATE
    after = np.maximum(t, 0.0)
    front = 1 - (1 + after / rise_s * 4) * np.exp(-after / rise_s * 4)
    late = after / duration_s * 6
    end = np.cos(0.5 * np.pi * np.clip((t / duration_s - 0.7) / 0.25, 0, 1)) ** 2
    return np.where(t > 0, front * (1 - late) * np.exp(-late) * end, 0.0)


def plain_normalised(
    recording: Float[np.ndarray, " sample"], template: Float[np.ndarray, " tap"]
) -> Float[np.ndarray, " output"]:
    """Return the correlation coefficient of a template at each place it fits.

    The usual detector: algorithm 6 of Parab's thesis, padded, over the energy of the
    stretch. It knows no colour.

    Args:
        recording: Samples.
        template: Samples, fewer.
    """
    size = 2 ** int(np.ceil(np.log2(recording.size)))
    product = np.fft.rfft(recording, size) * np.conj(np.fft.rfft(template, size))
    along = np.fft.irfft(product, size)[: recording.size - template.size + 1]
    sums = np.concatenate([[0.0], np.cumsum(recording**2)])
    energy = sums[template.size :] - sums[: -template.size]
    length = np.sqrt(np.maximum(energy, 1e-12 * sums[-1])) * np.linalg.norm(template)
    return along / length


class Shares(NamedTuple):
    """How many picks fail, by level.

    Attributes:
        failed: Share that is far off or not found.
        unmarked: Share that is far off and called good.
        marked: Share that is not called good, far off or not.
    """

    failed: Float[np.ndarray, " level"]
    unmarked: Float[np.ndarray, " level"]
    marked: Float[np.ndarray, " level"]


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


def shares_of(recorders: Sequence[Recorder]) -> Shares:
    """Return how many picks fail of records that are taken in each way."""
    rng = np.random.default_rng(SEED)
    truths = [readings(rng, scatter=True) for _ in range(LOGS)]
    records = []
    for recorder in recorders:
        # the same noise for each
        drawn = np.random.default_rng(SEED + 1)
        records += [r for one in truths for r in recorded(drawn, one, recorder)]
    picks = pick_records(records)
    truth = np.tile(np.concatenate(truths), (len(recorders), 1))
    far = np.array(
        [is_far_off(one, true) for one, true in zip(picks, truth, strict=True)]
    )
    good = np.array([one.quality == "good" for one in picks])
    found = np.array([bool(one.pick.found) for one in picks])
    shape = len(recorders), -1

    def share(which: Bool[np.ndarray, " record"]) -> Float[np.ndarray, " level"]:
        return which.reshape(shape).mean(axis=1)

    return Shares(share(far | ~found), share(far & good), share(~good))


def is_far_off(one: RecordPick, truth: Float[np.ndarray, "4"]) -> bool:
    """Return whether a value of a pick is off by more than it may be.

    Args:
        one: The pick.
        truth: Arrival, peak, duration and impulse.
    """
    found = one.pick
    arrival = float(found.air_arrival_s) - truth[0]
    others = np.array(
        [
            found.peak_overpressure_pa,
            found.positive_duration_s,
            found.positive_impulse_pa_s,
        ]
    )
    error = np.append(arrival, np.log(others / truth[1:]))
    return bool(np.any(np.abs(error) > OUTLIER_SD * np.asarray(found.spread)[:4]))


def uncertain_scene(*, scatter: bool) -> UncertainScene:
    """Return what is known before: all but the mass; the laws scatter, or are exact."""
    scene = Scene(Charge(mass_kg=MASS), scatter=scatter)
    return with_laws(freed(UncertainScene(scene), ["charge_mass_kg"]), LAWS)


def layout() -> Layout:
    """Return the rows that picks of all gauges fill, gauge by gauge."""
    count = len(RANGES)
    return Layout(
        quantity=RECORD_QUANTITIES * count,
        position=jnp.zeros((4 * count, 3)),
        slant_range=jnp.repeat(jnp.asarray(RANGES), 4),
        time=jnp.full(4 * count, jnp.nan),
        group=tuple(gauge for gauge in range(count) for _ in RECORD_QUANTITIES),
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
    values = [
        log_value(one, quantity) for one in picks for quantity in RECORD_QUANTITIES
    ]
    names = tuple(one.record.name for one in picks for _ in RECORD_QUANTITIES)
    return observed(
        names,
        RECORD_QUANTITIES * len(picks),
        [value for value, _ in values],
        [sigma for _, sigma in values],
        slant_range=np.repeat(np.array(RANGES), len(RECORD_QUANTITIES)),
        record=names,
        covariances=tuple(
            covariance_of(one, one.record.name, RECORD_QUANTITIES) for one in picks
        ),
    )
