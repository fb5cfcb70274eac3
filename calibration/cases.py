"""Simulated recordings with known truth: microphones, pressure records, sound, films.

Five microphones about a charge have few readings more than free parameters: mass,
position in the plane and time, without a prior, with exact or scattering laws. A normal
approximation is least accurate there.

Pressure records are pulses by the laws, sampled with noise and drift. The surface
charge of 15 kg is 8 to 40 m from the gauges. Position and time are known; the mass is
to be estimated. Sound for detectors is noise of a known spectrum with one pulse.

The moving disc has a bright edge that moves outwards. The logarithm of light is a
logistic of the distance from the edge, 1 px wide, so the radius at which a threshold is
crossed moves with the edge, and the camera events are known.
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jblast.inference.posterior.parameters import parameters_of
from jblast.observations import Observations, observed
from jblast.observations.records.recording import PressureRecord
from jblast.observations.table import RECORD_QUANTITIES
from jblast.scene import (
    Camera,
    Charge,
    Scene,
    Sensor,
    UncertainScene,
    freed,
    look_at,
    with_laws,
    with_values,
)
from jblast.scene.charge import Burst
from jblast.sensors import Layout, record
from jblast.sensors.calculator import Rows
from jblast.sensors.camera.fireball import Appearance
from jblast.signals import NoiseSpectrum
from jblast.signals.picks import RecordPick
from jblast.signals.picks.pick_log import covariance_of, log_value
from jblast.waves.fireballs import fireball_duration
from jblast.waves.paths import Path
from jblast.waves.pulse import pulse_of

POSITIONS = ((60, 0), (-70, 30), (0, 90), (20, -80), (120, 100))
"""East and north of each microphone [m]."""
READ = (("air_arrival_s", 1e-4), ("peak_overpressure_pa", 0.02))
"""Quantities of each microphone, with their standard errors [s], [-]."""
TRUTH = {
    "charge_mass_kg": 30.0,
    "charge_east_m": 10.0,
    "charge_north_m": -5.0,
    "origin_time_s": 1.5,
}
MICROPHONE_LAWS = {quantity: "shock_kinematics" for quantity, _ in READ}
HEIGHT, WIDTH = 48, 64
SHAPE = HEIGHT, WIDTH
# The last of the six thresholds is at 87 % of the rise. In the flat end of the edge 8
# bits hardly constrain the time (error 90 us if it is at 99 %).
DARK, BRIGHT = float(np.log(50 / 255)), float(np.log(200 / 255))
"""ln of the grey values outside and inside the disc."""
# The edge ends at 24 px, the half height: every pixel on its way is crossed once.
EDGE, SPEED, START, DURATION = 1.0, 260.0, 3.0, 0.08
"""Width [px], speed [px/s] and first radius [px] of the edge; duration [s]."""
# A usual setting of event cameras: a change of light of 22 %.
THRESHOLD = 0.2
"""Contrast threshold of the event camera [-]."""
MASS = 15.0
"""Charge of the films and of the pressure records [kg]: that of the thesis."""
BACKGROUND = 0.18
"""Linear grey behind the fire: the mid-grey of photography."""
RATE = 48000.0
"""Sampling rate of sound [Hz]."""
# Factors of about 1.4: scaled distances of 3 to 16 m/kg^(1/3).
RANGES = (8.0, 11.0, 15.0, 20.0, 28.0, 40.0)
"""Slant ranges of the gauges [m]."""
LAWS = dict.fromkeys(RECORD_QUANTITIES, "kingery_bulmash")
# Quiet samples for the noise level, and the whole negative phase.
BEFORE, BEHIND = 1.0, 6.0
"""Length of a record before and behind its front [durations]."""
# 0.7^64 is 1e-10: the first sample no longer matters.
SETTLES = 64
"""Discarded first samples of coloured noise."""
SUCTION, SUCTION_IMPULSE = 0.2, 0.6
"""Underpressure and negative impulse over peak and impulse, about those of the laws."""


def scene_with(
    *, scatter: bool, positions: Sequence[tuple[float, float]] = POSITIONS
) -> Scene:
    """Return a scene of microphones about a charge.

    Args:
        scatter: True for scattering laws, False for exact ones.
        positions: East and north of each microphone [m].
    """
    sensors = tuple(
        Sensor(f"m{i}", jnp.array([*position, 1.5]), records=READ)
        for i, position in enumerate(positions)
    )
    empty = dataclasses.replace(Scene(), scatter=scatter, sensors=sensors)
    return with_values(empty, TRUTH)


def standard_path(
    z: Float[np.ndarray, " place"], burst: Burst, mass: float = 1.0
) -> Path:
    """Return paths, in NumPy, to scaled distances from TNT on the ground.

    Args:
        z: Scaled distances [m/kg^(1/3)]; the air is that of sea level.
        burst: Curve set.
        mass: Mass of the charge [kg].
    """
    ranges = np.cbrt(mass) * z
    scene = Scene(Charge(burst=burst))
    return Rows(scene, ranges, np.full_like(ranges, mass)).path()


def radius(x: Float[Array, "..."], y: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return the distance from the centre of the disc [px]."""
    # off the pixel grid, so that no two pixels have the same distance
    return jnp.hypot(x - (WIDTH - 1) / 2 - 0.3, y - (HEIGHT - 1) / 2 + 0.2)


def disc_light(
    time: Float[Array, "..."],
    x: Float[Array, "..."],
    y: Float[Array, "..."],
    start: Float[Array, ""] | float = START,
    speed: Float[Array, ""] | float = SPEED,
) -> Float[Array, "..."]:
    """Return ln(light) at times [s], columns and rows."""
    outside = (radius(x, y) - start - speed * time) / EDGE
    return DARK + (BRIGHT - DARK) * jax.nn.sigmoid(-outside)


def disc_frames(times: Float[np.ndarray, " frame"]) -> Float[np.ndarray, "frame _ _"]:
    """Return images of ln(light); the disc rests from `DURATION` on."""
    return np.asarray(_frames(jnp.asarray(np.minimum(times, DURATION))))


@jax.jit
def _frames(times):
    x, y = jnp.meshgrid(*(jnp.arange(n, dtype=times.dtype) for n in (WIDTH, HEIGHT)))
    return jax.vmap(lambda time: disc_light(time, x, y))(times)


def film(
    fps: float | int,
) -> tuple[Float[np.ndarray, " frame"], Float[np.ndarray, "frame _ _"]]:
    """Return times [s], and images of ln(light)."""
    times = np.arange(round(DURATION * fps) + 1) / fps
    return times, disc_frames(times)


def analytic() -> tuple[
    Int[np.ndarray, " event"], Int[np.ndarray, " event"], Float[np.ndarray, " event"]
]:
    """Return pixel, number and time [s] of each event, sorted by pixel and time."""
    begin, end = (frame.ravel() for frame in disc_frames(np.array([0.0, DURATION])))
    number = np.floor((end - begin) / THRESHOLD).astype(int)
    pixel = np.repeat(np.arange(begin.size), number)
    nth = np.arange(1, pixel.size + 1) - np.repeat(np.cumsum(number) - number, number)
    y, x = np.divmod(pixel, WIDTH)
    share = (begin[pixel] + nth * THRESHOLD - DARK) / (BRIGHT - DARK)
    # the logistic inverted: distance from the edge at which the share is reached
    outside = EDGE * np.log(1.0 / share - 1.0)
    edge = np.asarray(radius(jnp.asarray(x, float), jnp.asarray(y, float))) - outside
    return pixel, nth, (edge - START) / SPEED


def passed_wholly() -> np.ndarray:
    """Return True for pixels that the whole edge has passed, row by row."""
    begin, end = disc_frames(np.array([0.0, DURATION]))
    return ((begin < DARK + 1e-3) & (end > BRIGHT - 1e-3)).ravel()


class Filmed(NamedTuple):
    """Film of one charge.

    Attributes:
        scene: 15 kg on the ground.
        camera: Camera at a distance of 40 m.
        times: Times from the burst to the end of the fire [s].
        appearance: Options of the fire, with or without light on the ground.
    """

    scene: Scene
    camera: Camera
    times: Float[np.ndarray, " frame"]
    appearance: Appearance


def filmed(
    frames: int, *, width: int = 640, height: int = 480, flash: bool = True
) -> Filmed:
    """Return a film of an explosion whose fireball is 0.4 image heights wide.

    Args:
        frames: Number of frames.
        width: Width of the image [px].
        height: Height of the image [px].
        flash: True if the fire lights the ground.
    """
    eye, life = np.array([0.0, -40.0, 2.0]), float(fireball_duration(MASS))
    camera = Camera(
        position=eye,
        quaternion=look_at(eye, np.array([0.0, 0.0, 4.0])),
        focal=np.full(2, 1.8 * height),
        center=0.5 * np.array([width - 1.0, height - 1.0]),
        width=width,
        height=height,
    )
    times = life * (np.arange(frames) + 0.5) / frames
    scene = Scene(Charge(mass_kg=MASS))
    return Filmed(scene, camera, times, Appearance(flash=flash))


def rumble(lines: bool = False) -> NoiseSpectrum:
    """Return the spectrum of wind, traffic and the noise of a recorder, over 90 dB.

    Args:
        lines: True to add the first three harmonics of a rotor, 141 Hz apart.
    """
    f = np.linspace(0.0, RATE / 2, 2049)
    # wind falls from 30 Hz on, traffic from 500 Hz on; 1e-9 is the recorder itself
    density = 1 / (1 + (f / 30) ** 2) ** 1.2 + 1e-5 / (1 + (f / 500) ** 2) + 1e-9
    if lines:
        density[[12, 24, 36]] *= 100.0
    return NoiseSpectrum(f, density)


def coloured(
    rng: np.random.Generator, noise: NoiseSpectrum, size: int, rows: int = 1
) -> Float[np.ndarray, "row sample"]:
    """Draw periodic noise of a spectrum, shape (rows, size).

    Args:
        rng: Random generator.
        noise: Spectrum of the noise.
        size: Number of samples of a row.
        rows: Number of rows.
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
        duration_s: Duration of the whole blast [s].
        delay: Delay of the blast, not necessarily whole [samples].
        rise_s: Rise time of the front [s].
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
    """Return the correlation coefficient of a template at each offset.

    This is the usual detector: algorithm 6 of Parab's thesis with padding, divided by
    the energy of the segment. It does not whiten the noise.

    Args:
        recording: Samples of the recording.
        template: Samples of the template, fewer than those of the recording.
    """
    size = 2 ** int(np.ceil(np.log2(recording.size)))
    product = np.fft.rfft(recording, size) * np.conj(np.fft.rfft(template, size))
    along = np.fft.irfft(product, size)[: recording.size - template.size + 1]
    sums = np.concatenate([[0.0], np.cumsum(recording**2)])
    energy = sums[template.size :] - sums[: -template.size]
    # cumulative sums may leave a rounding error below zero in a silent segment
    length = np.sqrt(np.maximum(energy, 1e-12 * sums[-1])) * np.linalg.norm(template)
    return along / length


@dataclass(frozen=True)
class Recorder:
    """Properties of a recorder and its disturbances.

    Attributes:
        snr: Peak over the noise of a sample.
        samples: Samples of a record.
        rise: Rise time of the front [samples].
        colour: Correlation of the noise of successive samples.
        wander: Amplitude of an oscillation of the baseline, as a share of the peak.
        wander_period: Period of the oscillation [durations].
        full_scale: Clipping level, as a share of the peak; None for no clipping.
        echo: Delay of a second wave [durations]; None for no second wave.
        echo_size: Peak of the second wave over that of the first.
        echo_rise: Rise time of the second wave [samples]; None for that of the first.
        before: Length of the record before the front [durations].
    """

    snr: float = 20.0
    samples: int = 1024
    rise: float = 2.0
    colour: float = 0.0
    wander: float = 0.0
    wander_period: float = 4.0
    full_scale: float | None = None
    echo: float | None = None
    echo_size: float = 0.3
    echo_rise: float | None = None
    before: float = BEFORE


def uncertain_scene(*, scatter: bool) -> UncertainScene:
    """Return the scene with a free mass, and with scattering or exact laws."""
    scene = Scene(Charge(mass_kg=MASS), scatter=scatter)
    return with_laws(freed(UncertainScene(scene), ["charge_mass_kg"]), LAWS)


def layout() -> Layout:
    """Return the layout of the picks of all gauges, gauge by gauge."""
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
) -> Float[np.ndarray, "gauge reading"]:
    """Draw arrival, peak, duration and impulse at each gauge, with scatter [SI]."""
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
    values: Float[np.ndarray, "gauge reading"],
    recorder: Recorder,
) -> list[PressureRecord]:
    """Return one record for each gauge, from `readings`."""
    found = []
    for gauge, parameters in enumerate(values.tolist()):
        arrival, peak, duration, _ = parameters
        step = (recorder.before + BEHIND) * duration / recorder.samples
        # a random shift of about a sample, so that fronts have no common phase
        start = arrival - (recorder.before + 0.01 * rng.uniform()) * duration
        edges = (np.arange(recorder.samples + 1) - 0.5) * step + start
        rise = recorder.rise * step
        samples = _wave(parameters, rise, edges)
        if recorder.echo is not None:
            later = [arrival + recorder.echo * duration, *parameters[1:]]
            slow = rise if recorder.echo_rise is None else recorder.echo_rise * step
            samples = samples + recorder.echo_size * _wave(later, slow, edges)
        samples = samples + _noise(rng, recorder) * peak / recorder.snr
        if recorder.wander:
            run = np.linspace(-0.5, 0.5, recorder.samples)
            turns = recorder.samples * step / (recorder.wander_period * duration)
            phase = 2.0 * np.pi * (turns * run + rng.uniform())
            samples = samples + recorder.wander * peak * np.cos(phase)
        level = recorder.full_scale
        if level is not None:
            level *= peak
            samples = np.clip(samples, -level, level)
        rate_hz = 1.0 / step
        record = PressureRecord(
            f"g{gauge}", samples, rate_hz=rate_hz, start_s=start, full_scale=level
        )
        found.append(record)
    return found


def _wave(parameters: Sequence[float], rise: float, edges: Float[np.ndarray, " edge"]):
    """Return the mean of a pulse over each sample."""
    arrival, peak, duration, impulse = parameters
    suction, negative_impulse = SUCTION * peak, SUCTION_IMPULSE * impulse
    pulse = pulse_of(arrival, peak, impulse, duration, rise, suction, negative_impulse)
    return np.asarray(pulse.mean(edges[:-1], edges[1:]))


def _noise(rng: np.random.Generator, recorder: Recorder):
    """Return autoregressive noise of first order and unit variance."""
    white = rng.standard_normal(recorder.samples + SETTLES)
    for k in range(1, white.size if recorder.colour else 0):
        innovation = np.sqrt(1 - recorder.colour**2)
        white[k] = recorder.colour * white[k - 1] + innovation * white[k]
    return white[SETTLES:]


def log_of_picks(picks: Sequence[RecordPick]) -> Observations:
    """Return the rows of the picks of all gauges, with their covariances."""
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


def recorded_template(
    samples: np.ndarray, rate_hz: float, start_s: float, duration_s: float
) -> np.ndarray:
    """Return an interval of a recording as a template, without the mean before it."""
    count, start = round(duration_s * rate_hz), round(start_s * rate_hz)
    template = samples[start : start + count] - samples[:start].mean()
    # a cut would be another front
    fading = max(round(0.2 * count), 1)
    template[-fading:] *= 0.5 + 0.5 * np.cos(
        np.pi * (np.arange(fading) + 1) / (fading + 1)
    )
    return template
