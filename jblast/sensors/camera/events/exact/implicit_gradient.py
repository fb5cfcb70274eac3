"""Event times that have gradients, of light that is a function of time."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jblast.sensors.camera.events.exact.light_curve import LogLight, value_and_slope
from jblast.sensors.camera.events.ideal import Events


def implicit_times(
    log_light: LogLight,
    events: Events,
    start: Float[ArrayLike, ""],
    thresholds: tuple[Float[ArrayLike, ""], Float[ArrayLike, ""]],
) -> Float[Array, " event"]:
    r"""Return the times of solved events as functions of the scene, for gradients.

    One step of Newton on $L(t) = L(t_0) + u C_+ - d C_-$, with u and d the events of
    the pixel so far: it stays where it is, and its derivative is that of the crossing.
    A crossing at which light stands still has none: infinite or NaN.

    Args:
        log_light: The scene, at the values for which the events were found.
        events: All of `frameless_events`, in their order.
        start: The first of its times [s].
        thresholds: One each for all pixels.
    """
    up, down = (jnp.asarray(v) for v in _sent(events))
    x, y, time = (jnp.asarray(v, float) for v in (events.x, events.y, events.time))
    positive, negative = thresholds
    begin = log_light(jnp.full_like(time, start), x, y)
    level = begin + up * positive - down * negative
    value, slope = value_and_slope(log_light, time, x, y)
    return time - (value - level) / jax.lax.stop_gradient(slope)


def _sent(events: Events) -> tuple[np.ndarray, np.ndarray]:
    """Count the events that each pixel has sent of each sign, up to each event."""
    y, x = np.asarray(events.y), np.asarray(events.x)
    order = np.lexsort((np.arange(y.size), x, y))
    sign = np.asarray(events.polarity)[order]
    new = np.append(True, (np.diff(x[order]) != 0) | (np.diff(y[order]) != 0))[: y.size]
    first = np.maximum.accumulate(np.where(new, np.arange(y.size), 0))
    counts = []
    for one in (sign > 0, sign < 0):
        total = np.cumsum(one)
        sent = np.empty(y.size)
        sent[order] = total - (total - one)[first]
        counts.append(sent)
    return counts[0], counts[1]
