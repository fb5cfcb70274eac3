r"""The pick of a record: what pulse it holds, and how sure that is.

A finite-rise modified Friedlander pulse with its negative phase (`waves/waveform/
pulse.py`) and a drift are fitted to the samples, under the noise of the quiet part
before the front. `unknowns.py` says what is believed beforehand, `ready/noise.py` how
noise is made white, `ready/bins.py` in what steps the record is looked at. All of it is
one pure function of arrays, batched, and differentiable through the optimum.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float

from jblast.errors import InputError, argument
from jblast.inference.picks.chunks import in_chunks
from jblast.inference.picks.fit.lanes import LanePicks, pick_lanes
from jblast.inference.picks.ready.clipped import clipped_samples
from jblast.inference.picks.result import Pick

LEAST_SAMPLES = 16
SHORTEST = 512
"""Records are filled up to this or a larger power of two, so that those of any length
are picked by few programs."""

UNEVEN = 1e-3
"""Times are even where none is farther off than this share of a sample (and of the
digits that they are written in)."""

FEW_SAMPLES = 8.0
"""Fewer samples of positive phase are few."""

LONG_SUCTION = 6.0
"""A negative phase of as many positive ones is rather a high-pass: laws have 1.8 to
4.5."""

DEEP_SUCTION = 0.1
"""And it takes as large a share of the impulse, depth times duration."""

UNTOLD = 0.05
"""A clipped peak whose ln is known no better than this is a lower bound."""


def pick(
    time_s: ArrayLike,
    pressure_pa: ArrayLike,
    *,
    full_scale_pa: float | None = None,
    high_pass_hz: float | None = None,
) -> Pick:
    """Return the pulses that records hold.

    Pure: under `jit`, `vmap` and `grad` it takes what it is given; outside, input that
    no record can be is refused.

    Args:
        time_s: Middle of each sample on one even clock [s], [sample].
        pressure_pa: Overpressure [Pa], [*batch, sample]. Any even scale does: it comes
            back in peak, impulse and suction.
        full_scale_pa: Largest size of a sample; larger ones are clipped. None: nobody
            said, and equal samples in a row at the extreme are taken for clipped.
        high_pass_hz: Corner of the instrument's first-order high-pass [Hz].

    Returns:
        Arrival, peak, duration, impulse and more, with their covariance, for each
        record.

    Raises:
        InputError: Times are not even or do not rise, lengths do not fit, or a value is
            not finite.

    Example:
        `found = jblast.pick(time_s, pressure_pa)`, then `found.positive_impulse_pa_s`
        and `found.sd("positive_impulse_pa_s")`.
    """
    time, pressure = _checked(time_s, pressure_pa)
    n, batch = pressure.shape[-1], pressure.shape[:-1]
    step = (time[-1] - time[0]) / (n - 1)
    flat = jnp.reshape(pressure, (-1, n))
    if filled_length(n) > n:
        flat = jnp.pad(flat, [(0, 0), (0, filled_length(n) - n)], mode="edge")
    counts = jnp.full(flat.shape[0], n)
    if high_pass_hz is not None and not (0 < high_pass_hz < np.inf):
        raise InputError(
            f"{argument('high_pass_hz')}: expected a positive corner, got "
            f"{high_pass_hz:g} Hz"
        )
    corner = None if high_pass_hz is None else step * high_pass_hz
    lanes = picked_lanes(flat, counts, full_scale_pa, corner)
    kind = flat.dtype
    start, step = jnp.asarray(time[0]).astype(kind), jnp.asarray(step).astype(kind)
    made = pick_of(lanes, start, step)
    return jax.tree.map(lambda x: x.reshape(*batch, *x.shape[1:]), made)


def filled_length(samples: int) -> int:
    """Return the length that a record is filled up to."""
    return max(SHORTEST, 1 << (samples - 1).bit_length())


def picked_lanes(
    samples: Float[Array, "lane sample"],
    counts: Array,
    full_scale: Float[ArrayLike, "..."] | None,
    high_pass: Float[ArrayLike, "..."] | None,
) -> LanePicks:
    """Return the picks of records in samples.

    Args:
        samples: Of records of one length, or filled up to it with their last sample.
        counts: How many samples each has.
        full_scale: Largest size of a sample, one for all or one for each; None: nobody
            said.
        high_pass: Corner of a first-order high-pass, in cycles a sample, one for all or
            one for each; None: there is none.
    """
    if full_scale is not None:
        full_scale = jnp.broadcast_to(
            jnp.asarray(full_scale).astype(samples.dtype), samples.shape[:1]
        )[:, None]
    clipped = clipped_samples(samples, jnp.asarray(counts), full_scale)
    if high_pass is None:
        return in_chunks(pick_lanes, (samples, clipped, counts))
    corner = 2.0 * np.pi * jnp.asarray(high_pass).astype(samples.dtype)
    corners = jnp.broadcast_to(corner, samples.shape[:1])
    return in_chunks(pick_lanes, (samples, clipped, counts, corners))


def pick_of(
    lanes: LanePicks, start: Float[Array, "..."], step: Float[Array, "..."]
) -> Pick:
    """Return picks in seconds and pascals.

    Args:
        lanes: In samples.
        start: Time of the first sample [s].
        step: From one sample to the next [s].
    """
    natural, scale = lanes.natural, lanes.scale
    nan = jnp.full_like(scale, jnp.nan)

    def where_found(value):
        return jnp.where(lanes.found, value, nan)

    seconds = jnp.broadcast_to(step, scale.shape)
    in_units = jnp.ones((*scale.shape, 8), scale.dtype).at[:, 0].set(seconds)
    found = lanes.found[:, None, None]
    covariance = jnp.where(
        found, lanes.covariance * in_units[:, :, None] * in_units[:, None, :], jnp.nan
    )
    spread = jnp.sqrt(jnp.diagonal(covariance, axis1=1, axis2=2))
    front = lanes.front.astype(scale.dtype)
    high = lanes.offset + scale * lanes.clipped_level
    low = jnp.abs(lanes.offset - scale * lanes.clipped_level)
    longer = natural.suction_duration > LONG_SUCTION * natural.duration
    # of one as shallow as noise allows the duration tells nothing
    deep = natural.suction * natural.suction_duration > DEEP_SUCTION * natural.impulse
    longer &= deep
    return Pick(
        air_arrival_s=where_found(start + step * (front + natural.arrival)),
        peak_overpressure_pa=where_found(scale * natural.peak),
        positive_duration_s=where_found(step * natural.duration),
        positive_impulse_pa_s=where_found(scale * step * natural.impulse),
        decay=where_found(natural.decay),
        rise_time_s=where_found(step * natural.rise),
        negative_pressure_pa=where_found(scale * natural.suction),
        negative_duration_s=where_found(step * natural.suction_duration),
        covariance=covariance[:, :4, :4],
        spread=spread,
        found=lanes.found,
        converged=lanes.converged,
        lower_bound=lanes.clipped & ~(spread[:, 1] < UNTOLD),
        clipped_at_pa=jnp.where(
            lanes.clipped, high, jnp.where(lanes.clipped_low, low, nan)
        ),
        under_sampled=natural.duration < FEW_SAMPLES,
        sharp=natural.rise < 1.0,
        high_passed=lanes.passed | (lanes.found & longer),
        resonating=lanes.rings,
        resonance_hz=jnp.where(
            lanes.rings, lanes.frequency / (2.0 * np.pi) / seconds, jnp.nan
        ),
        drifting=lanes.drifting,
        curving=lanes.curving,
        cut_short=lanes.cut_short,
        noise_known=lanes.noise_known,
        later_arrivals_s=where_found(start + step * (front + lanes.later))[:, None],
        later_sigmas_s=where_found(
            jnp.where(jnp.isnan(lanes.later), jnp.nan, step * lanes.later_sd)
        )[:, None],
        misfit=lanes.misfit,
        noise_pa=scale * lanes.noise,
        baseline_pa=lanes.offset + scale * lanes.level,
    )


def _checked(time_s: ArrayLike, pressure_pa: ArrayLike):
    """Return times, in double precision if they are numbers, and samples; or refuse."""
    pressure = (
        pressure_pa if isinstance(pressure_pa, Tracer) else np.asarray(pressure_pa)
    )
    time = time_s if isinstance(time_s, Tracer) else np.asarray(time_s, dtype=float)
    if pressure.ndim < 1 or time.ndim != 1 or time.shape[0] != pressure.shape[-1]:
        raise InputError(
            f"{argument('pressure_pa')}: expected [..., sample] with as many samples "
            f"as {argument('time_s')}, got {pressure.shape} and {time.shape}"
        )
    if time.shape[0] < LEAST_SAMPLES:
        raise InputError(
            f"{argument('pressure_pa')}: expected {LEAST_SAMPLES} samples or more, got "
            f"{time.shape[0]}"
        )
    if not isinstance(time, Tracer):
        _check_even(time)
    if not isinstance(pressure, Tracer):
        bad = np.argwhere(~np.isfinite(pressure))
        if bad.size:
            place = ", ".join(str(i) for i in bad[0])
            raise InputError(
                f"{argument('pressure_pa')}: expected finite samples, got "
                f"{pressure[tuple(bad[0])]} at [{place}]"
            )
    # in the widest precision there is: a record in few bits is no reason for less
    return time, jnp.asarray(pressure).astype(float)


def _check_even(time: Float[np.ndarray, " sample"]) -> None:
    """Refuse times that are not those of samples."""
    name = argument("time_s")
    if not np.all(np.isfinite(time)):
        raise InputError(f"{name}: expected finite times")
    steps = np.diff(time)
    if not np.all(steps > 0):
        first = int(np.argmax(~(steps > 0)))
        raise InputError(
            f"{name}: expected rising times, got {time[first]:.9g} and then "
            f"{time[first + 1]:.9g} s at [{first + 1}]"
        )
    even = np.linspace(time[0], time[-1], time.size)
    step = (time[-1] - time[0]) / (time.size - 1)
    off = np.abs(time - even)
    # times written with few digits are rounded, which is no gap
    if (
        np.max(off) > max(UNEVEN * step, 4e-16 * np.abs(time).max())
        and np.max(off) > 0.5 * step
    ):
        first = int(np.argmax(off))
        raise InputError(
            f"{name}: expected even steps of {step:.6g} s, got {time[first]:.9g} s at "
            f"[{first}], off by {off[first]:.3g} s"
        )
