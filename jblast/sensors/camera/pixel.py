r"""Pixels of an event camera: from the logarithm of light to events.

The input of a pixel is the logarithm of linear light, full scale 1, with a floor,

$$L = \ln \max(I, I_\mathrm{dark}).$$

Files of $b$ bits have the floor of half a step, $0.5 / (2^b - 1)$: a value of 0 is at
most that. Floats have no step; their floor is the dark level of a pixel, `DARKEST`.

The pixel compares $L$ with a reference. When $L$ is a threshold $C$ above or below, it
sends an event, and is held in reset for the period $\tau$. At the end of the reset the
reference is the $L$ of that moment, so that a change within the period is lost. Between
two frames $L$ is linear in time: where it changes at a rate $s$, the pixel sends an
event every $C/|s| + \tau$. An ideal pixel is one with a reset of zero length.

Imperfections change the same pixel: thresholds differ, a low-pass precedes it, and the
reference sinks, which gives leak events. Shot noise is added to the events.

One function, `interval`, is the pixel. Its times are offsets from the frame before, so
that single precision suffices on a device. `pixel_events` runs it there, under jit,
vmap and grad; `stream.event_stream` on the host, in float64.

For gradients of counts, `smooth_counts` replaces the $\lfloor u \rfloor$ events of a
change of $u$ thresholds by a staircase of logistic steps,
$\sum_k 1 / (1 + \exp((k - u) / T))$, and shifts the reference by the smooth count. As
the temperature $T$ goes to 0 the counts become those of ideal pixels. At $T$ a pixel
in constant light sends about $e^{-1/T}$ events per frame: 5e-5 at 0.1.

References:
    Rebecq, Gehrig and Scaramuzza (2018), ESIM: an open event camera simulator, eq. 1
    to 3, read second-hand.
    Lichtsteiner, Posch and Delbruck (2008), A 128 x 128 120 dB 15 us latency
    asynchronous temporal contrast vision sensor. IEEE J. Solid-State Circuits 43(2):
    566: table 1 for the dark level; section III, from memory, for the reset: after its
    event a pixel's switch is held closed, which balances its amplifier at the light of
    the moment the switch opens.
    Hu, Liu and Delbruck (2021), v2e: from video frames to realistic DVS events, for
    the imperfections, and the defaults of its program. Mismatch is 0.03 of a threshold
    of 0.2 there, and leak rates are log-normal over 0.1 decades (`emulator.py`). Its
    noise per frame averages out as frames become shorter, and is omitted. Hot pixels
    are a choice of ours.
"""

import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float, Int, PRNGKeyArray, UInt8

from jblast.errors import require
from jblast.sensors.camera.image import srgb_to_linear
from jblast.types import Module, field

DARKEST = 1e-6
"""Dark level of floats, as a fraction of full scale: 120 dB below it, the range of the
sensor of Lichtsteiner et al. (0.1 lux in a scene of 100,000 lux). Changes of darker
light cause no events; a lower level gives events of light that its dark current hides.
"""
Numbers = Float[Array | np.ndarray, "..."]
"""Arrays of the device or of the host."""


class Events(eqx.Module):
    """Events ordered by time, those of one time by pixel (row by row).

    Empty entries follow at the end: x and y -1, time infinite, polarity 0. NaN light
    crosses no threshold: inside jit, where it cannot be rejected, all times are NaN.

    Attributes:
        x: Column.
        y: Row, downwards.
        time: Seconds on the clock of the frames.
        polarity: +1 brighter, -1 darker.
        count: Number of events.
        lost: Number of events beyond the capacity.
    """

    x: Int[Array | np.ndarray, " event"]
    y: Int[Array | np.ndarray, " event"]
    time: Float[Array | np.ndarray, " event"]
    polarity: Int[Array | np.ndarray, " event"]
    count: Int[Array | np.ndarray, ""] | np.integer
    lost: Int[Array | np.ndarray, ""] | np.integer


class NoiseModel(NamedTuple):
    """Imperfections of a real event camera; None omits an effect.

    Attributes:
        mismatch: Standard deviation of the logarithm of thresholds between pixels.
        bandwidth_hz: Bandwidth of the photoreceptor, a first-order low-pass.
        leak_hz: Rate of brighter events of a pixel in constant light, by a sinking
            reference: the mean of all pixels except hot ones, without resets.
        leak_spread: Standard deviation of the logarithm of leak rates between pixels,
            hot pixels included.
        hot_fraction: Share of pixels that leak at `hot_hz`.
        hot_hz: Mean leak rate of hot pixels.
        shot_hz: Rate of noise events of a pixel, of either sign. They reset nothing.
        refractory_s: Time for which a pixel is held in reset after an event.
    """

    mismatch: float | None = 0.15
    bandwidth_hz: float | None = 300.0
    leak_hz: float | None = 0.01
    leak_spread: float = 0.1 * math.log(10.0)
    hot_fraction: float | None = 1e-4
    hot_hz: float = 10.0
    shot_hz: float | None = 0.001
    refractory_s: float | None = 0.5e-3


class ShotNoise(NamedTuple):
    """Noise events: Poisson in time, at any pixel, of either sign.

    Attributes:
        key: Random key.
        rate_hz: Rate of a pixel [Hz].
    """

    key: PRNGKeyArray
    rate_hz: float


class Pixel(Module):
    """Pixels of an event camera: one number for all, or one each (height, width).

    With the defaults they are ideal; `noisy_pixel` draws those of a real camera.

    Attributes:
        up: Threshold of brighter events, as a change of the logarithm of light.
        down: Threshold of darker events, as a positive number.
        period_s: Time for which a pixel is held in reset after an event.
        drift: Rate at which the reference sinks [1/s].
        begun: Logarithm of the first light minus the reference.
        bandwidth_hz: Bandwidth of the low-pass before the pixel; None for none.
        shot: Noise events; None for none.
    """

    up: Float[ArrayLike, "..."]
    down: Float[ArrayLike, "..."]
    period_s: Float[ArrayLike, "..."] = 0.0
    drift: Float[ArrayLike, "..."] = 0.0
    begun: Float[ArrayLike, "..."] = 0.0
    bandwidth_hz: float | None = field(static=True, default=None)
    shot: ShotNoise | None = None

    def __check_init__(self):
        """Reject thresholds that are not positive; tracers are not checked."""
        for name, threshold in (("positive", self.up), ("negative", self.down)):
            if not isinstance(threshold, Tracer):
                least, most = np.min(threshold), np.max(threshold)
                got = f"{least:g}" if least == most else f"{least:g} to {most:g}"
                valid = 0.0 < least <= most < math.inf
                require(valid, f"{name} threshold", "positive, finite numbers", got)


def noisy_pixel(
    key: PRNGKeyArray,
    thresholds: tuple[Float[ArrayLike, ""], Float[ArrayLike, ""]],
    noise: NoiseModel,
    shape: tuple[int, int],
) -> Pixel:
    """Return the pixels of a real camera.

    Args:
        key: Random key of mismatch, leaks, hot pixels and shot noise.
        thresholds: Positive and negative, as positive numbers.
        noise: Effects and their sizes.
        shape: Height and width.
    """
    mismatch, hot, rate, phase, shot = jax.random.split(key, 5)
    spread = (noise.mismatch or 0.0) * jax.random.normal(mismatch, (2, *shape))
    up, down = (t * jnp.exp(s) for t, s in zip(thresholds, spread, strict=True))
    is_hot = jax.random.uniform(hot, shape) < (noise.hot_fraction or 0.0)
    leak = jnp.where(is_hot, noise.hot_hz, noise.leak_hz or 0.0)
    # a log-normal factor of mean one: its median is exp(-spread^2 / 2)
    own = noise.leak_spread * jax.random.normal(rate, shape)
    own = jnp.exp(own - 0.5 * noise.leak_spread**2)
    # pixels leak at different times: a share of the first interval has passed
    begun = jnp.where(leak > 0.0, jax.random.uniform(phase, shape), 0.0)
    return Pixel(
        up,
        down,
        period_s=noise.refractory_s or 0.0,
        drift=leak * own * up,
        begun=begun * up,
        bandwidth_hz=noise.bandwidth_hz,
        shot=None if noise.shot_hz is None else ShotNoise(shot, noise.shot_hz),
    )


class Held(NamedTuple):
    """State of pixels between two frames.

    Attributes:
        lag: Light after the low-pass minus that before it; 0 at rest.
        level: Reference; undefined while the pixel is in reset.
        wait_s: Rest of the reset; 0 if the pixel is not in reset.
        parts: Number of parts of the stream so far.
    """

    lag: Numbers
    level: Numbers
    wait_s: Numbers
    parts: Int[Array | np.ndarray, ""] | int = 0


class Runs(NamedTuple):
    """Events of pixels in an interval; those of one pixel are evenly spaced.

    Attributes:
        sent: +k brighter, -k darker.
        first_s: Time of the first event since the start of the interval.
        pace_s: Time from one event to the next.
    """

    sent: Int[Array | np.ndarray, "..."]
    first_s: Numbers
    pace_s: Numbers


def first_held(pixel: Pixel, log_light: Numbers) -> Held:
    """Return the state of pixels at their first frame."""
    return Held(0.0 * log_light, log_light - pixel.begun, 0.0 * log_light)


def low_pass_lag(
    pixel: Pixel,
    lag: Numbers,
    before: Numbers,
    after: Numbers,
    length_s: float | Numbers,
) -> Numbers:
    """Return the lag of the low-pass at the end of an interval.

    Args:
        pixel: The pixels.
        lag: Light after the low-pass minus that before it, at the start.
        before: Logarithm of the light at the start.
        after: Logarithm of the light at the end.
        length_s: Length of the interval.
    """
    if pixel.bandwidth_hz is None:
        return lag
    # solution of signal' = rate * (light - signal) for light linear in time
    rate = 2.0 * math.pi * pixel.bandwidth_hz
    steady = (before - after) / (rate * length_s)
    xp = before.__array_namespace__()
    return steady + (lag - steady) * xp.exp(-rate * length_s)


def interval(
    pixel: Pixel, held: Held, before: Numbers, after: Numbers, length_s: float | Numbers
) -> tuple[Held, Runs]:
    """Return the state of pixels after an interval between frames, and their events.

    Args:
        pixel: The pixels.
        held: Their state at the start.
        before: Light after the low-pass at the start.
        after: Light after the low-pass at the end.
        length_s: Length of the interval.
    """
    xp = before.__array_namespace__()
    # a sinking reference equals a rising signal
    sunk = pixel.drift * length_s
    after = after + sunk
    slope = (after - before) / length_s
    in_reset = held.wait_s > length_s  # throughout
    begin = xp.where(in_reset, 0.0, held.wait_s)
    level = xp.where(begin > 0.0, before + slope * begin, held.level)
    change, slack = after - level, rounding(after)
    sign = xp.where(change + slack >= pixel.up, 1, 0)
    sign = xp.where(slack - change >= pixel.down, -1, sign)
    sign = xp.where(in_reset | (slope == 0.0), 0, sign)
    sends = sign != 0
    size = xp.where(sign > 0, pixel.up, pixel.down)
    step = sign * size
    steep = xp.where(sends, slope, 1.0)
    first = xp.clip((level + step - before) / steep, begin, length_s)
    steep = xp.abs(steep)
    # after each reset the light needs this time to change by a threshold again
    pace = pixel.period_s + size / steep
    # an event exactly at the end of the interval belongs to it
    more = xp.floor((length_s - first + slack / steep) / pace)
    count = xp.where(sends, 1.0 + xp.maximum(more, 0.0), 0.0)
    last = xp.minimum(first + (count - 1.0) * pace, length_s)
    wait = xp.where(sends, last + pixel.period_s, held.wait_s) - length_s
    # each event shifts the reference by its threshold, and by the change in its reset
    level = level + count * (step + slope * pixel.period_s) - sunk
    held = held._replace(level=level, wait_s=xp.maximum(wait, 0.0))
    return held, Runs(sign * count.astype(sign.dtype), first, pace)


def rounding(log_light: Numbers) -> Numbers:
    """Return the margin within which a threshold counts as reached.

    A rise of exactly k thresholds gives k events, whatever the rounding.
    """
    # 16 rounding errors: those of a level, a difference and a logarithm add up to less
    return 16.0 * float(np.finfo(log_light.dtype).eps) * (1.0 + abs(log_light))


def pixel_events(
    log_frames: Float[Array, "frame height width"],
    times: Float[Array, " frame"],
    pixel: Pixel,
    held: Held | None = None,
    *,
    capacity: int,
) -> tuple[Events, Held]:
    """Return the events of frames: none at the first.

    Parts of a stream give the events of the whole if each begins with the last frame of
    the one before, and with its state.

    Args:
        log_frames: Logarithm of the light (`log_intensity`).
        times: Times of the frames [s], rising.
        pixel: The pixels.
        held: Their state at the first frame; None at the beginning of a stream.
        capacity: Largest number of events. If there are more, those of the earliest
            intervals are returned and `lost` counts the others.

    Returns:
        The events, and the state at the last frame.

    Raises:
        InputError: Outside jit: times do not rise, or light is not finite.

    Example:
        `events, _ = pixel_events(logs, times, Pixel(0.2, 0.2), capacity=10_000)`
    """
    require(len(times) > 1, "frames", "two or more", len(times))
    check_light(log_frames)
    if not isinstance(times, Tracer):
        check_times(np.asarray(times))
    held = first_held(pixel, log_frames[0]) if held is None else held

    def step(held: Held, frames) -> tuple[Held, Runs]:
        before, after, length = frames
        lag = low_pass_lag(pixel, held.lag, before, after, length)
        signals = before + held.lag, after + lag
        return interval(pixel, held._replace(lag=lag), *signals, length)

    lengths = jnp.diff(times).astype(log_frames.dtype)
    held, runs = jax.lax.scan(step, held, (log_frames[:-1], log_frames[1:], lengths))
    shape = log_frames.shape[1:]
    pixels = shape[0] * shape[1]
    cell, offset, sign, total = _listed(runs, lengths, capacity)
    place, time = cell % pixels, times[cell // pixels] + offset.astype(times.dtype)
    if pixel.shot is not None:
        key = jax.random.fold_in(pixel.shot.key, held.parts)
        span = times[-1] - times[0]
        noise = shot_events(key, pixel.shot.rate_hz * pixels * span, pixels, capacity)
        ours = (place, time, sign, total)
        found = noise[0], times[0] + span * noise[1].astype(time.dtype), *noise[2:]
        place, time, sign, total = (
            jnp.append(a, b.astype(a.dtype)) for a, b in zip(ours, found, strict=True)
        )
    total = total.sum()
    time = jnp.where(sign == 0, jnp.inf, time)
    order = jnp.lexsort((place, time))[:capacity]
    place, sign, time = place[order], sign[order], time[order]
    y, x = (jnp.where(sign == 0, -1, at) for at in jnp.divmod(place, shape[1]))
    time = jnp.where(jnp.isnan(log_frames).any(), jnp.nan, time)
    count = jnp.minimum(total, capacity)
    held = held._replace(parts=held.parts + 1)
    return Events(x, y, time, sign, count, total - count), held


def _listed(runs: Runs, lengths: Float[Array, " interval"], capacity: int):
    """Return interval and pixel, time offset and sign of each event, and their number.

    Entries beyond that number have sign 0.
    """
    number = jnp.abs(runs.sent).ravel()
    ends = jnp.cumsum(number)
    slot = jnp.arange(capacity, dtype=ends.dtype)
    # inverse of the cumulated counts: each slot finds its interval and pixel
    cell = jnp.searchsorted(ends, slot, side="right")
    cell = jnp.minimum(cell, number.size - 1)
    earlier = (slot - ends[cell] + number[cell]).astype(lengths.dtype)
    offset = runs.first_s.ravel()[cell] + earlier * runs.pace_s.ravel()[cell]
    offset = jnp.minimum(offset, lengths[cell // (number.size // len(lengths))])
    sign = jnp.where(slot < ends[-1], jnp.sign(runs.sent.ravel()[cell]), 0)
    return cell, jnp.where(sign == 0, 0.0, offset), sign, ends[-1]


def shot_events(
    key: PRNGKeyArray, mean: Float[ArrayLike, ""], pixels: int, capacity: int
) -> tuple[
    Int[Array, " event"], Float[Array, " event"], Int[Array, " event"], Int[Array, ""]
]:
    """Return noise events, of which there are `mean` on average.

    Returns:
        Row times width plus column, time as a share of the duration, sign (0 for empty
        entries), and the number of events, which may exceed the entries.
    """
    number, where, when, which = jax.random.split(key, 4)
    count = jax.random.poisson(number, mean)
    place = jax.random.randint(where, (capacity,), 0, pixels)
    share = jax.random.uniform(when, (capacity,))
    sign = 2 * jax.random.bernoulli(which, shape=(capacity,)).astype(place.dtype) - 1
    return place, share, jnp.where(jnp.arange(capacity) < count, sign, 0), count


def check_times(
    times: Float[np.ndarray, " frame"], before: float = -math.inf, frame: int = 0
) -> None:
    """Reject times that do not rise.

    Args:
        times: Times of frames [s].
        before: Time of the frame before them [s].
        frame: Number of the first, for the message.

    Raises:
        InputError: A time is not later than the one before.
    """
    rises = np.diff(times, prepend=before) > 0.0
    n = np.argmin(rises)
    got = f"{times[n]:g} s at frame {frame + n}"
    require(rises.all(), "frames", "times that rise from frame to frame", got)


def check_light(light: Numbers | UInt8[np.ndarray, "..."], frame: int = 0) -> None:
    """Reject light that is not finite: it never crosses a threshold.

    Inside jit it is not checked.

    Args:
        light: Frames of light or of its logarithm, (frame, height, width).
        frame: Number of the first, for the message.

    Raises:
        InputError: A pixel's light is not finite.
    """
    if isinstance(light, Tracer) or light.dtype.kind != "f":
        return
    finite = np.isfinite(np.asarray(light))
    n, row, column = np.unravel_index(np.argmin(finite), finite.shape)
    value = light[n, row, column]
    got = f"{value} in frame {frame + n}, row {row}, column {column} (the first is 0)"
    require(finite.all(), "frames", "light that is a finite number", got)


def darkest_of(bits: int | None) -> float:
    """Return the floor of files with a bit depth, full scale 1; None for floats."""
    return DARKEST if bits is None else 0.5 / ((1 << bits) - 1)


EIGHT_BITS = darkest_of(8)
"""Floor of grey values and colours of 8 bits."""


def log_intensity(
    light: Float[ArrayLike, "..."], darkest: float = DARKEST
) -> Float[Array, "..."]:
    """Return the logarithm of linear light, full scale 1, not below the floor.

    Args:
        light: Linear light, full scale 1.
        darkest: The floor, as a fraction of full scale (`darkest_of`).
    """
    return jnp.log(jnp.maximum(jnp.asarray(light), darkest))


def grey_light(*, srgb: bool = False) -> Float[np.ndarray, "256"]:
    """Return the linear light of each of the 256 grey values of an 8-bit image.

    Args:
        srgb: True if the values are sRGB (IEC 61966-2-1), false for linear light.
    """
    value = np.arange(256) / 255.0
    return srgb_to_linear(value) if srgb else value


def smooth_counts(
    log_frames: Float[Array, "frame height width"],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
    temperature: Float[ArrayLike, ""],
    *,
    most: int = 16,
) -> tuple[
    Float[Array, "interval height width"], Float[Array, "interval height width"]
]:
    """Return the smooth counts of brighter and darker events of each interval.

    Args:
        log_frames: Logarithm of the light.
        thresholds: Positive and negative, as positive numbers.
        temperature: Width of a step, in thresholds: 0.05 to 0.2.
        most: Largest number of events of a pixel in an interval; steps beyond are not
            counted.
    """
    positive, negative = (jnp.asarray(threshold) for threshold in thresholds)
    steps = jnp.arange(1, most + 1, dtype=log_frames.dtype)[:, None, None]

    def staircase(change):
        return jax.nn.sigmoid((change[None] - steps) / temperature).sum(axis=0)

    def step(level, log_light):
        change = log_light - level
        up, down = staircase(change / positive), staircase(-change / negative)
        return level + up * positive - down * negative, (up, down)

    return jax.lax.scan(step, log_frames[0], log_frames[1:])[1]
