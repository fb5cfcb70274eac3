r"""Events of an ideal event camera: threshold crossings of the logarithm of light.

The input of a pixel is the logarithm of linear light, full scale 1, with a floor,

$$L = \ln \max(I, I_\mathrm{dark}).$$

Files of $b$ bits have the floor of half a step, $0.5 / (2^b - 1)$: a value of 0 is at
most that. Floats have no step; their floor is the dark level of a pixel, `DARKEST`.

The pixel compares $L$ with a reference. Each time $L$ is a threshold above or below, it
sends an event and moves its reference by that threshold. Between two frames $L$ is
linear in time, so all its events there have one sign. First all events are counted,
then as many as there is room for are written, each at the time at which $L$ crosses the
threshold. That time is second order in the frame interval, and differentiable. All of
it works under jit, vmap and grad.

A pixel may instead be held in reset after each event for the refractory period $\tau$.
At its end the reference is the $L$ of that moment. So a change of $L$ within the period
is lost, not postponed; where $L$ rises at a rate $s$ the pixel sends an event every
$C/s + \tau$.

For gradients of counts, `smooth_counts` replaces the $\lfloor u \rfloor$ events of a
change of $u$ thresholds by a staircase of logistic steps,
$\sum_k 1 / (1 + \exp((k - u) / T))$, and moves the reference by the smooth count. As
the temperature $T$ goes to 0 the counts become those of `ideal_events`. At $T$ a still
pixel sends about $e^{-1/T}$ events a frame: 5e-5 at 0.1.

For comparison, `frame_differences` makes events as Parab's thesis does: one event where
the grey value of a pixel changes by more than a threshold from one frame to the next,
at the time of the second, whatever the change. Its polarity is inverted, 0 for brighter
and 1 for darker, and becomes -1 and +1 here. This is not a model of an event camera,
which responds to the logarithm of light, each pixel in its own time, several times a
frame.

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

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float, Int, UInt8

from jblast.errors import InputError
from jblast.sensors.camera.image import linear_to_srgb, srgb_to_linear
from jblast.types import as_float_array

Thresholds = tuple[Float[Array, "..."], Float[Array, "..."]]
"""Positive and negative, both as positive numbers; one for all pixels or one each."""
DARKEST = 1e-6
"""Dark level of floats, as a fraction of full scale: 120 dB below it, the range of the
sensor of Lichtsteiner et al. (0.1 lux in a scene of 100,000 lux). Changes of darker
light give no events; a lower level gives events of light that its dark current hides.
"""
WEIGHTS = (0.299, 0.587, 0.114)
"""Of red, green and blue in the grey of 8 bits (ITU-R BT.601)."""
STEP = 15
"""Change of the grey value past which there is an event, of 255."""
Grey = UInt8[np.ndarray, "height width"]


class Events(eqx.Module):
    """Events in order of time, those of one time in order of pixel (row by row).

    Empty places stand at the end: x and y -1, time infinite, polarity 0. Light that is
    no number crosses no threshold: inside jit, where it cannot be refused, all times
    are NaN.

    Attributes:
        x: Column.
        y: Row, downwards.
        time: Seconds on the clock of the frames.
        polarity: +1 brighter, -1 darker.
        count: How many there are.
        lost: How many more there were than room.
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
    """Return what an ideal event camera sends: no event at the first frame.

    Args:
        log_frames: Logarithm of the light (`log_intensity`).
        times: Of the frames [s], rising.
        thresholds: Positive and negative, as positive numbers; one for all pixels or
            an array (height, width).
        capacity: Room for so many events. If there are more, those of the earliest
            intervals are kept and `lost` counts the others.

    Raises:
        InputError: Outside jit: a threshold is not positive, times do not rise, or
            light is not finite.
    """
    return continued_events(
        log_frames, times, thresholds, first_reference(log_frames[0]), capacity=capacity
    )[0]


class Reference(eqx.Module):
    """The reference level of every pixel.

    It is kept as whole numbers of thresholds from where it began, so that a long
    stream gathers no rounding errors.

    Attributes:
        first: Logarithm of the light at the first frame.
        up: Events sent so far by which the reference rose.
        down: Likewise fell.
    """

    first: Float[Array, "..."]
    up: Int[Array, "..."]
    down: Int[Array, "..."]

    def level(self, thresholds: Thresholds) -> Float[Array, "..."]:
        """Return the level itself."""
        positive, negative = thresholds
        number = self.first.dtype
        net, down = (self.up - self.down).astype(number), self.down.astype(number)
        # not up * positive - down * negative: both grow for ever, and cancel
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
    log_frames, times, both = _fitting(log_frames, times, thresholds)
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
        part = jnp.clip((target - before) / change, 0.0, 1.0).astype(times.dtype)
        return times[interval] + part * (times[interval + 1] - times[interval])

    return _marked(_write_out(counts, when, capacity), log_frames), after


def reset_events(
    log_frames: Float[Array, "frame height width"],
    times: Float[Array, " frame"],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
    refractory_s: Float[ArrayLike, ""],
    first: Float[Array, "height width"],
    *,
    capacity: int,
) -> Events:
    """Return the events of pixels that are held in reset after each of them.

    Arguments and errors as those of `ideal_events`; further:

    Args:
        log_frames: Logarithm of the light.
        times: Of the frames [s], rising.
        thresholds: Positive and negative.
        refractory_s: How long a pixel is held [s].
        first: Reference of the pixels at the first frame.
        capacity: Room for so many events.
    """
    log_frames, times, both = _fitting(log_frames, times, thresholds)
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

    return _marked(_write_out(runs.count, when, capacity), log_frames)


def _marked(events: Events, light: Float[Array, "frame height width"]) -> Events:
    """Return events without times where light was no number."""
    unknown = jnp.isnan(light).any()
    return replace(events, time=jnp.where(unknown, jnp.nan, events.time))


def _fitting(
    log_frames: Float[Array, "frame height width"],
    times: Float[Array, " frame"],
    thresholds: tuple[Float[ArrayLike, "..."], Float[ArrayLike, "..."]],
) -> tuple[
    Float[Array, "two_or_more height width"], Float[Array, " two_or_more"], Thresholds
]:
    """Return frames with an interval between them, and thresholds of each pixel."""
    check_thresholds(thresholds)
    check_light(log_frames)
    clock_rises = isinstance(times, Tracer) or (np.diff(np.asarray(times)) > 0).all()
    if not clock_rises:
        raise InputError("times: expected times that rise from frame to frame")
    dtype, shape = log_frames.dtype, log_frames.shape[1:]
    if len(log_frames) == 1:  # no interval: one in which nothing happens
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
    """Give each event counted its place, time and sign.

    Args:
        counts: Of each interval and pixel: +k brighter, -k darker.
        when: The time of an event: of which interval and pixel, the how-manieth, and
            of which sign.
        capacity: Room for so many.
    """
    width, pixels = counts.shape[2], counts.shape[1] * counts.shape[2]
    number = jnp.abs(counts).ravel()
    ends = jnp.cumsum(number)
    total = ends[-1]
    slot = jnp.arange(capacity, dtype=ends.dtype)
    valid = slot < total
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
    """Refuse thresholds that no pixel can have; inside jit they are not looked at.

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
    """Refuse light that is no number: no threshold is ever crossed by it.

    Inside jit it is not looked at.

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
    """Return the reference of pixels that see their first frame."""
    none = jnp.zeros(log_light.shape, jnp.int32)
    return Reference(log_light, none, none)


def rounding(log_light, module=jnp):
    """Return how far short of a threshold still counts as having reached it.

    A rise of exactly k thresholds gives k events, whatever the rounding.
    """
    eps = float(np.finfo(log_light.dtype).eps)
    return 16.0 * eps * (1.0 + module.abs(log_light))


def crossings(log_light, level, thresholds, module=jnp):
    """Return the thresholds crossed since the last frame: +k up, -k down.

    Args:
        log_light: The logarithm of the light now.
        level: The reference level.
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
        reference: As it is at the first of these frames.

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
        level: The reference; without meaning while the pixel is held.
        until: When it is let go [s]; -inf if it is not held.
    """

    level: Float[Array, "..."]
    until: Float[Array, "..."]


class Runs(eqx.Module):
    """Events of each interval between frames, and after it: they are evenly spaced.

    Attributes:
        count: +k brighter, -k darker.
        first: When the first of them is sent [s].
        pace: From one to the next [s].
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
        times: Of the frames [s], rising.
        thresholds: Positive and negative.
        refractory_s: How long a pixel is held [s].
        held: As it is at the first of these frames.
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
    pace = refractory_s + size / jnp.abs(steep)
    late = rounding(jnp.maximum(jnp.abs(start), jnp.abs(stop)))
    more = jnp.floor((stop - first + late) / pace)
    count = sign * (1 + jnp.maximum(more, 0.0).astype(sign.dtype))
    end = first + jnp.maximum(more, 0.0) * pace + refractory_s
    until = jnp.where(sends, end, jnp.where(gone, held.until, -jnp.inf))
    free = until <= stop  # let go within the interval: the reference is known already
    level = jnp.where(sends & free, before + slope * (end - start), level)
    held = Held(level, jnp.where(free, -jnp.inf, until))
    return held, Runs(count, first, pace)


def darkest_of(bits: int | None) -> float:
    """Return the floor of files with a bit depth, full scale 1; None is floats."""
    return DARKEST if bits is None else 0.5 / ((1 << bits) - 1)


EIGHT_BITS = darkest_of(8)
"""The floor of grey values and colours of 8 bits."""


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
        srgb: Whether the values are sRGB (IEC 61966-2-1) and not linear light.
        darkest: The floor, as a fraction of full scale.
    """
    return np.log(np.maximum(_grey_light(srgb), darkest))


def count_below(frames: np.ndarray, darkest: float, *, srgb: bool = False) -> int:
    """Return the number of values darker than a floor.

    Args:
        frames: Grey values of 8 bits, or linear light, full scale 1.
        darkest: The floor, as a fraction of full scale.
        srgb: Whether values of 8 bits are sRGB.
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
        most: Events a pixel can send in an interval; steps beyond are not counted.
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


def frame_differences(
    frames: Iterable[tuple[float, Grey]], step: int = STEP
) -> Iterator[Events]:
    """Yield the events of each frame but the first; -1 brighter, +1 darker.

    Args:
        frames: Time [s] and grey values of each, in order of time.
        step: Change past which there is an event, of 255.
    """
    before: np.ndarray | None = None
    for time, grey in frames:
        light = grey.astype(np.int16)
        if before is not None:
            change = light - before
            y, x = np.nonzero(np.abs(change) > step)
            count = np.array(x.size)
            yield Events(
                x=x.astype(np.int32),
                y=y.astype(np.int32),
                time=np.full(x.size, float(time)),
                polarity=np.where(change[y, x] > 0, -1, 1).astype(np.int8),
                count=count,
                lost=np.array(0),
            )
        before = light


def grey_bytes(frame: Float[np.ndarray, "height width 3"]) -> Grey:
    """Return the grey values of 8 bits of a frame of linear light."""
    shown = linear_to_srgb(np.clip(frame, 0.0, 1.0))
    return np.rint(255.0 * (shown @ np.asarray(WEIGHTS))).astype(np.uint8)
