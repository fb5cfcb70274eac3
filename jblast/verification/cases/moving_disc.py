"""A bright disc whose edge moves out: a scene whose events are known.

The logarithm of light is a logistic of the distance from the edge, 1 px wide. So the
radius at which a threshold is crossed moves with the edge.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

HEIGHT, WIDTH = 48, 64
SHAPE = HEIGHT, WIDTH
# the last of the six thresholds lies at 87 % of the rise: in the flat end of the edge
# 8 bits tell little of the time (90 us if it lies at 99 %)
DARK, BRIGHT = float(np.log(50 / 255)), float(np.log(200 / 255))
EDGE, SPEED, START, DURATION = 1.0, 260.0, 3.0, 0.08
"""Width [px], speed [px/s] and first radius [px] of the edge; of the scene [s]."""
THRESHOLD = 0.2


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
