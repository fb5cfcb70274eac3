"""An ideal event pixel: how many thresholds its logarithm of light has crossed.

The pixel compares the logarithm of the light L with a reference. Each time L is a
threshold above or below, the pixel sends an event and moves its reference by that
threshold. Between two frames L is linear in time, so all its events have one sign.

References:
    Rebecq, Gehrig and Scaramuzza (2018), ESIM: an open event camera simulator, eq. 1
    to 3, read second-hand.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float, Int

from jblast.errors import InputError

Thresholds = tuple[Float[Array, "..."], Float[Array, "..."]]
"""Positive and negative, both as positive numbers; one for all pixels or one each."""


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


def first_reference(log_light: Float[Array, "..."]) -> Reference:
    """Return the reference of pixels that see their first frame."""
    none = jnp.zeros(log_light.shape, jnp.int32)
    return Reference(log_light, none, none)


def rounding(log_light, module=jnp):
    """Return how far short of a threshold still counts as having reached it.

    A rise of exactly k thresholds gives k events, whatever the last bits say.
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
