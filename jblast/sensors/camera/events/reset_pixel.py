r"""An event pixel that is held in reset after each event.

The pixel compares the logarithm of the light L with a reference, as the ideal one does.
When L is a threshold above or below, it sends an event and is held in reset for the
refractory period $\tau$: it sees nothing. At the end its reference is what L then is,
and it starts anew. So what L does within the period is lost, not put off; where L rises
at a rate $s$ the pixel sends an event every $C/s + \tau$.

References:
    Lichtsteiner, Posch and Delbruck (2008), A 128 x 128 120 dB 15 us latency
    asynchronous temporal contrast vision sensor, section III, from memory: after its
    event a pixel's switch is held closed, which balances its amplifier at the light of
    the moment the switch opens.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jblast.sensors.camera.events.pixel import Thresholds, rounding


class Held(eqx.Module):
    """What a pixel remembers.

    Attributes:
        level: The reference; it says nothing while the pixel is held.
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


def let_go(level: Float[Array, "..."]) -> Held:
    """Return pixels with these references, none of them held."""
    return Held(level, jnp.full_like(level, -jnp.inf))


def reset_runs(
    log_frames: Float[Array, "frame ..."],
    times: Float[Array, " frame"],
    thresholds: Thresholds,
    refractory_s: Float[Array, ""],
    held: Held,
) -> tuple[Runs, Held]:
    """Return the events of each interval, and what the pixels remember at the end.

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
    """Return what pixels remember after an interval, and their events in it."""
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
