r"""Events of an ideal event camera: threshold crossings of the logarithm of light.

The input of a pixel is the logarithm of linear light, full scale 1, with a floor,

$$L = \ln \max(I, I_\mathrm{dark}).$$

Files of $b$ bits have the floor of half a step, $0.5 / (2^b - 1)$: a value of 0 is at
most that. Floats have no step; their floor is the dark level of a pixel, `DARKEST`.

The pixel compares $L$ with a reference. Each time $L$ is a threshold above or below, it
sends an event and shifts its reference by that threshold. Between two frames $L$ is
linear in time, so all its events there have one sign. First all events are counted,
then as many as the capacity permits are written, each at the time at which $L$ crosses
the threshold. That time is of second order in the frame interval, and differentiable.
All of it works under jit, vmap and grad.

A pixel may instead be held in reset after each event for the refractory period $\tau$.
At its end the reference is the $L$ of that moment. A change of $L$ within the period is
therefore lost, not postponed. Where $L$ rises at a rate $s$ the pixel sends an event
every $C/s + \tau$.

For gradients of counts, `smooth_counts` replaces the $\lfloor u \rfloor$ events of a
change of $u$ thresholds by a staircase of logistic steps,
$\sum_k 1 / (1 + \exp((k - u) / T))$, and shifts the reference by the smooth count. As
the temperature $T$ goes to 0 the counts become those of `ideal_events`. At $T$ a pixel
in constant light sends about $e^{-1/T}$ events per frame: 5e-5 at 0.1.

References:
    Rebecq, Gehrig and Scaramuzza (2018), ESIM: an open event camera simulator, eq. 1
    to 3, read second-hand.
    Lichtsteiner, Posch and Delbruck (2008), A 128 x 128 120 dB 15 us latency
    asynchronous temporal contrast vision sensor. IEEE J. Solid-State Circuits 43(2):
    566: table 1 for the dark level; section III, from memory, for the reset: after its
    event a pixel's switch is held closed, which balances its amplifier at the light of
    the moment the switch opens.
    Facts of the camera plugin of gazebo_blast3d (July 2025), which is GPL, for the
    differences of frames. Its scene sets the threshold; the default here is that of its
    detector.
"""

from collections.abc import Callable
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float, Int

from jblast.errors import InputError
from jblast.sensors.camera.image import srgb_to_linear
from jblast.types import as_float_array

Thresholds = tuple[Float[Array, "..."], Float[Array, "..."]]
"""Positive and negative, both as positive numbers; one for all pixels or one each."""
DARKEST = 1e-6
"""Dark level of floats, as a fraction of full scale: 120 dB below it, the range of the
sensor of Lichtsteiner et al. (0.1 lux in a scene of 100,000 lux). Changes of darker
light cause no events; a lower level gives events of light that its dark current hides.
"""


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
    count: Int[Array | np.ndarray, ""]
    lost: Int[Array | np.ndarray, ""]


def ideal_events(
    log_frames: Float[Array, "frame height width"],
    times: Float[Array, " frame"],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
    *,
    capacity: int,
) -> Events:
    """Return the events of an ideal event camera: none at the first frame.

    Args:
        log_frames: Logarithm of the light (`log_intensity`).
        times: Times of the frames [s], rising.
        thresholds: Positive and negative, as positive numbers; one for all pixels or
            an array (height, width).
        capacity: Largest number of events. If there are more, those of the earliest
            intervals are returned and `lost` counts the others.

    Raises:
        InputError: Outside jit: a threshold is not positive, times do not rise, or
            light is not finite.
    """
    return continued_events(
        log_frames, times, thresholds, first_reference(log_frames[0]), capacity=capacity
    )[0]


class Reference(eqx.Module):
    """Reference level of every pixel.

    It is stored as whole numbers of thresholds from its initial value, so that a long
    stream accumulates no rounding errors.

    Attributes:
        first: Logarithm of the light at the first frame.
        up: Number of events by which the reference rose.
        down: Number of events by which it fell.
    """

    first: Float[Array, "..."]
    up: Int[Array, "..."]
    down: Int[Array, "..."]

    def level(self, thresholds: Thresholds) -> Float[Array, "..."]:
        """Return the reference level."""
        positive, negative = thresholds
        number = self.first.dtype
        net, down = (self.up - self.down).astype(number), self.down.astype(number)
        # not up * positive - down * negative: both grow without bound, and cancel
        return self.first + net * positive + down * (positive - negative)


def continued_events(
    log_frames: Float[Array, "frame height width"],
    times: Float[Array, " frame"],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
    reference: Reference,
    *,
    capacity: int,
) -> tuple[Events, Reference]:
    """Return the events of a part of a stream, and the reference for the next part.

    Parts give the events of the whole if each begins with the last frame of the one
    before. Arguments and errors as those of `ideal_events`.
    """
    log_frames, times, both = _checked(log_frames, times, thresholds)
    counts, levels, after = count_events(log_frames, both, reference)
    pixels = log_frames[0].size
    flat = log_frames.reshape(-1, pixels)
    positive, negative = (threshold.ravel() for threshold in both)

    def when(cell, nth, sign):
        interval, pixel = cell // pixels, cell % pixels
        step = jnp.where(sign > 0, positive[pixel], -negative[pixel])
        before, after = flat[interval, pixel], flat[interval + 1, pixel]
        change = jnp.where(sign != 0, after - before, 1.0)
        target = levels.ravel()[cell] + nth.astype(step.dtype) * step
        # the margin of `rounding` may place a crossing just outside its interval
        part = jnp.clip((target - before) / change, 0.0, 1.0).astype(times.dtype)
        return times[interval] + part * (times[interval + 1] - times[interval])

    return _nan_if_undefined(_write_out(counts, when, capacity), log_frames), after


def reset_events(
    log_frames: Float[Array, "frame height width"],
    times: Float[Array, " frame"],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
    refractory_s: Float[ArrayLike, ""],
    first: Float[Array, "height width"],
    *,
    capacity: int,
) -> Events:
    """Return the events of pixels that are held in reset after each event.

    Arguments and errors as those of `ideal_events`; further:

    Args:
        log_frames: Logarithm of the light.
        times: Times of the frames [s], rising.
        thresholds: Positive and negative.
        refractory_s: Time for which a pixel is held [s].
        first: Reference of the pixels at the first frame.
        capacity: Largest number of events.
    """
    log_frames, times, both = _checked(log_frames, times, thresholds)
    dtype = jnp.promote_types(log_frames.dtype, times.dtype)  # a signal at any time
    log_frames, times, both, first = jax.tree.map(
        lambda v: v.astype(dtype), (log_frames, times, both, first)
    )
    period = as_float_array(refractory_s).astype(dtype)
    runs, _ = reset_runs(
        log_frames, times, both, period, Held(first, jnp.full_like(first, -jnp.inf))
    )

    def when(cell, nth, sign):
        del sign
        later = (nth - 1).astype(dtype) * runs.pace.ravel()[cell]
        return runs.first.ravel()[cell] + later

    return _nan_if_undefined(_write_out(runs.count, when, capacity), log_frames)


def _nan_if_undefined(
    events: Events, light: Float[Array, "frame height width"]
) -> Events:
    """Return events with times of NaN if any light is NaN."""
    unknown = jnp.isnan(light).any()
    return replace(events, time=jnp.where(unknown, jnp.nan, events.time))


def _checked(
    log_frames: Float[Array, "frame height width"],
    times: Float[Array, " frame"],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
) -> tuple[
    Float[Array, "two_or_more height width"], Float[Array, " two_or_more"], Thresholds
]:
    """Return two or more frames with their times, and thresholds of each pixel."""
    check_thresholds(thresholds)
    check_light(log_frames)
    if not isinstance(times, Tracer):
        falls = np.flatnonzero(~(np.diff(np.asarray(times)) > 0))
        if falls.size:
            raise InputError(
                "times: expected times that rise from frame to frame, got "
                f"{float(times[falls[0] + 1]):g} s after {float(times[falls[0]]):g} s"
            )
    dtype, shape = log_frames.dtype, log_frames.shape[1:]
    if len(log_frames) == 1:  # an interval without change, so that shapes are not empty
        log_frames = jnp.repeat(log_frames, 2, axis=0)
        times = jnp.stack([times[0], times[0] + 1.0])
    positive, negative = (
        jnp.broadcast_to(as_float_array(threshold).astype(dtype), shape)
        for threshold in thresholds
    )
    return log_frames, times, (positive, negative)


def _write_out(
    counts: Int[Array, "interval height width"],
    when: Callable[[Array, Array, Array], Float[Array, " event"]],
    capacity: int,
) -> Events:
    """Return counted events with pixel, time and sign.

    Args:
        counts: Signed number in each interval and pixel: +k brighter, -k darker.
        when: Time of an event by its interval and pixel, its number among those, and
            its sign.
        capacity: Largest number of events.
    """
    width, pixels = counts.shape[2], counts.shape[1] * counts.shape[2]
    number = jnp.abs(counts).ravel()
    ends = jnp.cumsum(number)
    total = ends[-1]
    slot = jnp.arange(capacity, dtype=ends.dtype)
    valid = slot < total
    # inverse of the cumulated counts: each slot finds its interval and pixel
    cell = jnp.searchsorted(ends, slot, side="right")
    cell = jnp.minimum(cell, number.size - 1)
    nth = slot - (ends[cell] - number[cell]) + 1
    pixel = cell % pixels
    sign = jnp.where(valid, jnp.sign(counts.ravel()[cell]), 0)
    time = jnp.where(valid, when(cell, nth, sign), jnp.inf)
    order = jnp.lexsort((pixel, time))
    x, y = (jnp.where(valid, at, -1) for at in (pixel % width, pixel // width))
    count = jnp.minimum(total, capacity)
    return Events(*(x[order], y[order], time[order], sign[order]), count, total - count)


def check_thresholds(
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
) -> None:
    """Reject thresholds that are not positive; inside jit they are not checked.

    Raises:
        InputError: One is not a positive, finite number.
    """
    for name, threshold in zip(("positive", "negative"), thresholds, strict=True):
        if isinstance(threshold, Tracer):
            continue
        number = np.asarray(threshold)
        bad = number[~((number > 0) & np.isfinite(number))]
        if bad.size:
            raise InputError(
                f"{name} threshold: expected positive numbers, got {bad.flat[0]:g}"
            )


def check_light(light: ArrayLike, frame: int = 0) -> None:
    """Reject light that is not finite: it never crosses a threshold.

    Inside jit it is not checked.

    Args:
        light: Frames of light or of its logarithm, (frame, height, width, ...).
        frame: Number of the first, for the message.

    Raises:
        InputError: A pixel's light is not finite.
    """
    if isinstance(light, Tracer):
        return
    values = np.asarray(light)
    if values.dtype.kind != "f" or np.isfinite(values).all():
        return
    at = np.argwhere(~np.isfinite(values))[0]
    raise InputError(
        f"frames: expected light that is a finite number, got {values[tuple(at)]} in "
        f"frame {frame + at[0]}, row {at[1]}, column {at[2]} (the first is 0)"
    )


def first_reference(log_light: Float[Array, "..."]) -> Reference:
    """Return the reference of pixels at their first frame."""
    none = jnp.zeros(log_light.shape, jnp.int32)
    return Reference(log_light, none, none)


def rounding(log_light, module=jnp):
    """Return the margin within which a threshold counts as reached.

    A rise of exactly k thresholds gives k events, whatever the rounding.
    """
    # 16 rounding errors: those of a level, a difference and a logarithm add up to less
    eps = float(np.finfo(log_light.dtype).eps)
    return 16.0 * eps * (1.0 + module.abs(log_light))


def crossings(log_light, level, thresholds, module=jnp):
    """Return the thresholds crossed since the last frame: +k up, -k down.

    Args:
        log_light: Current logarithm of the light.
        level: Reference level.
        thresholds: Positive and negative.
        module: `jax.numpy`, or `numpy` for arrays of the host.
    """
    positive, negative = thresholds
    change, slack = log_light - level, rounding(log_light, module)
    up = module.floor((change + slack) / positive)
    down = module.floor((slack - change) / negative)
    crossed = module.maximum(up, 0.0) - module.maximum(down, 0.0)
    return crossed.astype(np.int32)


def count_events(
    log_frames: Float[Array, "frame ..."],
    thresholds: Thresholds,
    reference: Reference,
) -> tuple[Int[Array, "interval ..."], Float[Array, "interval ..."], Reference]:
    """Count the events of each interval between frames.

    Args:
        log_frames: Logarithm of the light.
        thresholds: Positive and negative.
        reference: Reference at the first of these frames.

    Returns:
        Events of each interval (+k brighter, -k darker), the reference level at its
        start, and the reference after the last frame.
    """

    def step(reference: Reference, log_light: Float[Array, "..."]):
        level = reference.level(thresholds)
        crossed = crossings(log_light, level, thresholds)
        after = Reference(
            reference.first,
            reference.up + jnp.maximum(crossed, 0),
            reference.down - jnp.minimum(crossed, 0),
        )
        return after, (crossed, level)

    after, (counts, levels) = jax.lax.scan(step, reference, log_frames[1:])
    return counts, levels, after


class Held(eqx.Module):
    """State of pixels that are held in reset after an event.

    Attributes:
        level: Reference; undefined while the pixel is held.
        until: End of the reset [s]; -inf if the pixel is not held.
    """

    level: Float[Array, "..."]
    until: Float[Array, "..."]


class Runs(eqx.Module):
    """Events of each interval and of the resets it starts; they are evenly spaced.

    Attributes:
        count: +k brighter, -k darker.
        first: Time of the first event [s].
        pace: Time from one event to the next [s].
    """

    count: Int[Array, "interval ..."]
    first: Float[Array, "interval ..."]
    pace: Float[Array, "interval ..."]


def reset_runs(
    log_frames: Float[Array, "frame ..."],
    times: Float[Array, " frame"],
    thresholds: Thresholds,
    refractory_s: Float[Array, ""],
    held: Held,
) -> tuple[Runs, Held]:
    """Return the events of each interval, and the state of the pixels at the end.

    Args:
        log_frames: Logarithm of the light, linear between two frames.
        times: Times of the frames [s], rising.
        thresholds: Positive and negative.
        refractory_s: Time for which a pixel is held [s].
        held: State at the first of these frames.
    """

    def step(held: Held, frame):
        before, after, start, stop = frame
        return _interval(held, before, after, start, stop, thresholds, refractory_s)

    frames = log_frames[:-1], log_frames[1:], times[:-1], times[1:]
    held, runs = jax.lax.scan(step, held, frames)
    return runs, held


def _interval(held: Held, before, after, start, stop, thresholds, refractory_s):
    """Return the state of pixels after an interval, and their events in it."""
    positive, negative = thresholds
    # still held at the start of the interval, and throughout it
    waits, gone = held.until > start, held.until > stop
    slope = (after - before) / (stop - start)
    begin = jnp.where(waits & ~gone, held.until, start)
    level = jnp.where(waits & ~gone, before + slope * (begin - start), held.level)
    change, slack = after - level, rounding(after)
    sign = jnp.where(change + slack >= positive, 1, 0)
    sign = jnp.where(change - slack <= -negative, -1, sign)
    sign = jnp.where(gone | (slope == 0.0), 0, sign)
    sends = sign != 0
    size = jnp.where(sign > 0, positive, negative)
    steep = jnp.where(sends, slope, 1.0)
    first = start + (level + sign * size - before) / steep
    first = jnp.clip(first, begin, stop)
    # after each reset the light needs this time to change by a threshold again
    pace = refractory_s + size / jnp.abs(steep)
    # an event exactly at the end of the interval belongs to it
    late = rounding(jnp.maximum(jnp.abs(start), jnp.abs(stop)))
    more = jnp.floor((stop - first + late) / pace)
    count = sign * (1 + jnp.maximum(more, 0.0).astype(sign.dtype))
    end = first + jnp.maximum(more, 0.0) * pace + refractory_s
    until = jnp.where(sends, end, jnp.where(gone, held.until, -jnp.inf))
    free = until <= stop  # released within the interval: the reference is known already
    level = jnp.where(sends & free, before + slope * (end - start), level)
    held = Held(level, jnp.where(free, -jnp.inf, until))
    return held, Runs(count, first, pace)


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


def grey_table(
    *, srgb: bool = False, darkest: float = EIGHT_BITS
) -> Float[np.ndarray, "256"]:
    """Return the logarithm of each of the 256 grey values of an 8-bit image.

    Args:
        srgb: True if the values are sRGB (IEC 61966-2-1), false for linear light.
        darkest: The floor, as a fraction of full scale.
    """
    return np.log(np.maximum(_grey_light(srgb), darkest))


def count_below(frames: np.ndarray, darkest: float, *, srgb: bool = False) -> int:
    """Return the number of values darker than a floor.

    Args:
        frames: Grey values of 8 bits, or linear light, full scale 1.
        darkest: The floor, as a fraction of full scale.
        srgb: True if values of 8 bits are sRGB.
    """
    if frames.dtype == np.uint8:
        return int(np.count_nonzero(frames < (_grey_light(srgb) < darkest).sum()))
    return int(np.count_nonzero(frames < darkest))


def _grey_light(srgb: bool) -> Float[np.ndarray, "256"]:
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
