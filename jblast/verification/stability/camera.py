"""Failure modes of lens formulas and of the arithmetic of event cameras.

The formulas of a lens fail behind the camera and beyond the fold of its distortion; the
arithmetic of events fails in long streams, by rounding and at cuts between batches.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from calibration.cases import THRESHOLD, film
from calibration.surrogate import STAGES
from jblast.errors import InputError
from jblast.scene import Camera
from jblast.sensors.camera.events.exact import frameless_events
from jblast.sensors.camera.events.ideal import (
    Reference,
    count_events,
    first_reference,
    ideal_events,
    smooth_counts,
)
from jblast.sensors.camera.events.stream import stream_events
from jblast.sensors.camera.geometry import fold_radius, project, unproject
from jblast.verification.stability.failure import (
    FailureMode,
    crossing,
    first_failure,
    switching_point,
    verified,
)

BOTH = (THRESHOLD, THRESHOLD)
"""Positive and negative contrast threshold [-]."""
# A count of 1,000 gives a share of lost events to about 0.02.
RAMPS = 1000
"""Number of random ramps."""
# 40 thresholds of up to 0.5: a factor of e^20 in light, more than any scene has.
MAX_STEPS = 40
"""Largest number of thresholds in a ramp."""
# Thresholds of real pixels differ by some per cent, so a smaller error is not visible.
REFERENCE_ERROR = 0.01
"""Largest accepted error of a reference, as a share of a threshold."""
# At 1,000 events/s a pixel needs 17 minutes for so many.
MAX_EVENTS = 1 << 20
"""Largest simulated number of events of one pixel."""
# Five cuts in the film of 81 frames.
BLOCK = 16
"""Frames in a block."""
# 10 events/s at 1,000 frames/s; the noise of a real pixel is lower.
STILL_PIXEL_EVENTS = 0.01
"""Largest accepted number of events of a still pixel [1/frame]."""
_convert = jax.jit(ideal_events, static_argnames="capacity")
# k1 = -0.3 is usual for a wide lens; the fold, at 1/sqrt(0.9), is inside its view.
BARREL = (-0.3, 0.0, 0.0, 0.0, 0.0)
"""Distortion coefficients of a wide lens [-]."""


def event_failures() -> list[FailureMode]:
    """Measure every failure mode."""
    return [
        _sum(),
        _rounded(),
        _cut(),
        _short(),
        _warm(),
        behind_failure(),
        fold_failure(),
    ]


def summed_errors() -> tuple[Float[np.ndarray, " event"], Float[np.ndarray, " event"]]:
    """Return the float32 error of a reference by the number of events [thresholds].

    The light rises by three thresholds and falls by two larger ones (1.5 times), again
    and again. The first array is for a running sum, the second for whole counts.
    """
    up, down = np.float32(THRESHOLD), np.float32(1.5 * THRESHOLD)
    rises = np.resize([True, True, True, False, False], MAX_EVENTS)
    ups, downs = np.cumsum(rises), np.cumsum(~rises)
    first = np.float32(-1.7)
    moves = np.where(rises, up, -down).astype(np.float32)
    running = np.cumsum(np.append(first, moves), dtype=np.float32)[1:]
    counted = Reference(
        jnp.full(MAX_EVENTS, first), *(jnp.asarray(n, jnp.int32) for n in (ups, downs))
    )
    level = np.asarray(counted.level((jnp.asarray(up), jnp.asarray(down))))
    exact = float(first) + ups * float(up) - downs * float(down)
    sums, counts = (
        np.abs(value.astype(float) - exact) / THRESHOLD for value in (running, level)
    )
    return sums, counts


def _sum() -> FailureMode:
    running, counted = summed_errors()
    begin = first_failure(running > REFERENCE_ERROR, "sum of thresholds in float32")
    lost = np.flatnonzero(counted > REFERENCE_ERROR)
    ours = int(lost[0]) if lost.size else MAX_EVENTS
    message = (
        f"{REFERENCE_ERROR:.0%} after {ours:,} events" if lost.size else "no error"
    )
    return FailureMode(
        area="events",
        method="reference of a pixel in float32",
        failure="a sum of thresholds accumulates rounding errors",
        boundary=float(begin),
        unit="events",
        beyond=f"off by {REFERENCE_ERROR:.0%} of a threshold there, by "
        f"{running.max():.0%} within {MAX_EVENTS:,} events",
        response=verified("holds", ours > 10 * begin, "references"),
        message=f"whole counts: {message} in float32; streams count in float64",
    )


def lost_to_rounding() -> tuple[int, int]:
    """Return the number of `RAMPS` ramps with a lost event, by division and by jblast.

    A ramp rises by exactly k thresholds, in floating-point numbers.
    """
    rng = np.random.default_rng(0)
    threshold = rng.uniform(0.05, 0.5, RAMPS)
    number = rng.integers(1, MAX_STEPS + 1, RAMPS)
    begin = rng.uniform(-6.0, 0.0, RAMPS)
    end = begin + number * threshold
    bare = np.floor((end - begin) / threshold)
    both = jnp.asarray(threshold), jnp.asarray(threshold)
    frames = jnp.asarray(np.stack([begin, end]))
    ours, _, _ = count_events(frames, both, first_reference(frames[0]))
    return int((bare != number).sum()), int((np.asarray(ours[0]) != number).sum())


def _rounded() -> FailureMode:
    bare, ours = lost_to_rounding()
    return FailureMode(
        area="events",
        method="count of a ramp of k thresholds",
        failure="the last event is lost to rounding",
        boundary=float(bare),
        unit=f"of {RAMPS}",
        beyond=f"floor(change/threshold) is k - 1 in {bare} of {RAMPS}, "
        f"k to {MAX_STEPS}",
        response=verified("holds", ours == 0, "ramps"),
        message="a threshold counts as reached from 16 roundings below it: none lost",
    )


def cut_counts() -> tuple[int, int, int]:
    """Return the events of a film, of its parts converted alone, and of the stream."""
    times, logs = film(1000)
    parts = [slice(a, a + BLOCK) for a in range(0, len(times), BLOCK)]

    def count(part: slice) -> int:
        light, clock = jnp.asarray(logs[part]), jnp.asarray(times[part])
        return int(_convert(light, clock, BOTH, capacity=1 << 14).count)

    blocks = ((times[part], logs[part]) for part in parts)
    stream = stream_events(blocks, BOTH, in_logarithms=True)
    together = sum(int(events.count) for events in stream)
    return count(slice(None)), sum(count(part) for part in parts), together


def _cut() -> FailureMode:
    whole, alone, together = cut_counts()
    return FailureMode(
        area="events",
        method="a recording in separate blocks",
        failure="a change that began before a block is lost",
        boundary=1.0,
        unit="cuts and more",
        beyond=f"blocks of {BLOCK} frames: {alone:,} of {whole:,} events",
        response=verified("holds", together == whole, "blocks"),
        message="stream_events passes the references on: the events of the whole film",
    )


def pulse_counts(width: float) -> tuple[int, int]:
    """Return the events of a pulse five thresholds high, from frames and without.

    Args:
        width: Standard deviation of the pulse [frames], centred between two frames.
    """
    times = np.arange(7.0)

    def light(time, x, y):
        return 5.01 * THRESHOLD * jnp.exp(-0.5 * jnp.square((time - 2.5) / width))

    clock = jnp.asarray(times)
    frames = light(clock, 0.0, 0.0)[:, None, None]
    seen = _convert(frames, clock, BOTH, capacity=64)
    return int(seen.count), int(frameless_events(light, (1, 1), times, BOTH).count)


def _short() -> FailureMode:
    seen = 0.2
    boundary = switching_point(lambda w: pulse_counts(w)[0] == 0, 0.05, 0.5, to=1e-3)
    frames, ours = pulse_counts(seen)
    return FailureMode(
        area="events",
        method="events of frames, linear between them",
        failure="a flash between two frames is missed",
        boundary=boundary,
        unit="frames, pulse's sigma, and less",
        beyond=f"sigma = {seen:g} frames: {frames} of 10 events",
        response=verified("holds", ours == 10, "a short pulse"),
        message=f"frameless_events finds {ours} from the same first samples",
    )


def still_count(temperature: float) -> float:
    """Return the number of smooth events of a still pixel in a frame, of both signs."""
    up, down = smooth_counts(jnp.zeros((2, 1, 1)), BOTH, temperature)
    return float((up + down).sum())


def _warm() -> FailureMode:
    boundary = crossing(lambda t: still_count(t) - STILL_PIXEL_EVENTS, 0.05, 1.0)
    last = STAGES[-1][0]
    return FailureMode(
        area="events",
        method="smooth counts",
        failure=f"a still pixel sends {STILL_PIXEL_EVENTS:g} events a frame",
        boundary=boundary,
        unit="= temperature and above",
        beyond=f"{still_count(0.3):.2g} a frame at 0.3, {still_count(0.5):.2g} at 0.5",
        response=verified(
            "holds", still_count(last) < 0.1 * STILL_PIXEL_EVENTS, "smooth counts"
        ),
        message=f"fit_events cools down to {last:g}: {still_count(last):.1g} a frame",
    )


def wide_camera(distortion=BARREL) -> Camera:
    """Return a wide camera (over 90 degrees) at the origin that looks north."""
    return Camera(
        position=jnp.zeros(3),
        quaternion=jnp.array([-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]),
        focal=jnp.full(2, 200.0),
        center=jnp.array([319.5, 239.5]),
        width=640,
        height=480,
        distortion=jnp.array(distortion),
    )


def behind_failure() -> FailureMode:
    """Measure the pixel that the pinhole formula gives a point behind the camera."""
    camera = wide_camera((0.0,) * 5)
    point = jnp.array([1.0, -5.0, 0.5])  # behind, to the right, above
    found = project(camera, point)
    (fx, fy), (cx, cy) = np.asarray(camera.focal), np.asarray(camera.center)
    x, y, z = 1.0, -0.5, -5.0
    ahead = project(camera, jnp.array([1.0, 5.0, 0.5]))
    seen = bool(ahead.seen) and not bool(found.seen)
    return FailureMode(
        area="events",
        method="pinhole projection x/z",
        failure="a point behind the camera has a pixel",
        boundary=0.0,
        unit="m ahead and less",
        beyond=f"5 m behind: pixel ({fx * x / z + cx:.0f}, {fy * y / z + cy:.0f}) of "
        "640 x 480, upside down",
        response=verified("marks", seen, "a point behind the camera"),
        message="seen false, and a finite pixel, so that gradients stay finite",
    )


def fold_failure() -> FailureMode:
    """Measure the angle at which the distortion of a wide lens folds over."""
    camera = wide_camera()
    edge = float(fold_radius(camera.distortion, jnp.array([1.0, 0.0])))
    out = 1.4 * edge
    bent = out * (1.0 + BARREL[0] * out**2)
    beyond = project(camera, jnp.array([out, 1.0, 0.0]))
    inside = project(camera, jnp.array([0.99 * edge, 1.0, 0.0]))
    most = edge * (1.0 + BARREL[0] * edge**2)
    refused = False
    try:
        unproject(camera, camera.center + jnp.array([200.0 * 1.01 * most, 0.0]))
    except InputError:
        refused = True
    seen = bool(inside.seen) and not bool(beyond.seen) and refused
    return FailureMode(
        area="events",
        method=f"lens distortion, k1 = {BARREL[0]:g}",
        failure="the formula folds over: two directions have one pixel",
        boundary=float(np.degrees(np.arctan(edge))),
        unit="degrees off the axis",
        beyond=f"{np.degrees(np.arctan(out)):.0f} degrees off the axis are projected "
        f"to x = {bent:.2f}, inside the {most:.2f} of the fold",
        response=verified("marks", seen, "the fold"),
        message="seen false; unproject refuses a pixel past the fold",
    )
