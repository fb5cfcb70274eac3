r"""The pick of a pressure record: its pulse, with covariance.

A Friedlander pulse with a finite rise and a negative phase (`waves/pulse.py`)
and a drift are fitted to the samples, with the noise of the quiet part before the
front. `unknowns` has the priors, `preparation` the noise and the bins, `lanes` the fit.
All of it is one pure function of arrays, batched, and differentiable through the
optimum.

Records are padded to a power of two and picked in chunks of `LANES`, so that few
programs serve records of any length and number. Each device runs its own program:
partitioned as one program, the small systems of equations of the search would be
gathered from all devices.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike as ArrayOrNumber, Bool, Float
from numpy.typing import ArrayLike

from jblast.errors import InputError, argument
from jblast.kept_programs import kept
from jblast.signals.picks.lanes import LanePicks, pick_lanes
from jblast.signals.picks.preparation import clipped_samples
from jblast.signals.picks.unknowns import CONTINUED, Form

LEAST_SAMPLES = 16
"""Smallest number of samples of a record: pulse and drift have 11 unknowns, and the
noise before the front has its own."""
CLOCK_TOLERANCE = 1e-3
"""Largest deviation from even times, as a share of a sample. Deviations of up to half a
sample pass where the digits of the times explain them."""
SHORTEST_PADDED = 512
"""Shortest padded record [samples]. Records are padded to powers of two from here on,
so that few programs serve records of any length: each compiles for 40 to 50 s."""
FEW_SAMPLES = 8.0
"""Duration below which a pulse is marked as under-sampled [samples]: there are no more
samples than unknowns of the pulse, so the priors of its form matter."""
LONG_SUCTION = 6.0
"""Ratio of negative to positive phase from which on a high-pass is the more probable
cause: laws have 1.8 to 4.5 (`unknowns`)."""
DEEP_SUCTION = 0.1
"""Depth times duration of such a phase, over the positive impulse, from which on it
counts: a shallower one is noise, and its duration is no sign."""
BOUND_PEAK_SD = 0.05
"""Standard deviation of ln peak from which on a clipped peak is a lower bound. A better
one, reconstructed from the decay, is used with its error."""
LANES = 32
"""Records of one chunk. Another number would be another program to compile; each
device runs chunks of its own."""
Result = TypeVar("Result")
NAMES = (
    "air_arrival_s",
    "peak_overpressure_pa",
    "positive_duration_s",
    "positive_impulse_pa_s",
    "decay",
    "rise_time_s",
    "negative_pressure_pa",
    "negative_duration_s",
)
"""Picked values, in the order of `Pick.spread`."""
IN_LOG = 4
"""Number of values, the first of `NAMES`, that a log contains with their covariance."""


class Pick(eqx.Module):
    """The pulse of a record, or of each record of a batch.

    Errors are those of the posterior with rise, suction and drift free. Values are NaN
    if no pulse was found.

    Attributes:
        air_arrival_s: Start of the rise, on the clock of the samples [s].
        peak_overpressure_pa: Overpressure behind the front [Pa].
        positive_duration_s: Duration of the positive phase, rise included [s].
        positive_impulse_pa_s: Impulse of the positive phase [Pa s].
        decay: Friedlander's $b$ behind the rise [-].
        rise_time_s: Rise time from zero to the peak [s].
        negative_pressure_pa: Greatest underpressure; noise may make it negative in a
            record without a negative phase [Pa].
        negative_duration_s: Duration of the negative phase [s].
        covariance: Covariance of arrival [s], ln peak, ln duration and ln impulse.
        spread: Standard deviations of the eight values in the order of `NAMES`: of
            arrival [s], decay [-] and the logarithms of the others.
        found: True if there is a pulse.
        converged: True if the search ended at an optimum.
        lower_bound: True if samples were clipped at the peak, so that only
            `clipped_at_pa` and the prior constrain it.
        clipped_at_pa: Largest absolute value of a clipped sample; NaN without any [Pa].
        under_sampled: True if the positive phase has fewer than eight samples.
        sharp: True if the rise is shorter than a sample, so that the arrival may be
            anywhere within one.
        high_passed: True if the record looks high-passed and no corner was specified.
        resonating: True if the record contains a resonance of the sensor.
        drifting: True if the baseline moves by more than 2 % of the peak.
        curving: True if it bends by more than 3 % of the peak within the fitted
            interval, where a cubic may not describe it.
        cut_short: True if the record ends before the positive phase.
        noise_known: True if there were enough quiet samples before the front.
        shifted: True if the baseline steps at the front and stays there.
        front_alone: True if the pressure behind the front is no blast pulse, so that
            the front alone was fitted and only arrival and peak are identified.
        resonance_hz: Undamped frequency of the resonance; NaN without one [Hz].
        later_arrivals_s: Arrival of a further front within the fitted interval, at most
            one; NaN without one [s].
        later_sigmas_s: Their standard deviations [s].
        misfit: Squared misfit per degree of freedom, about 1 where the model holds [-].
            Above 1, errors are widened by its root.
        noise_pa: Standard deviation of the noise of a sample [Pa].
        baseline_pa: Baseline at the arrival [Pa].
        form: Formulas of the likeliest pulse.
    """

    air_arrival_s: Float[Array, "*batch"]
    peak_overpressure_pa: Float[Array, "*batch"]
    positive_duration_s: Float[Array, "*batch"]
    positive_impulse_pa_s: Float[Array, "*batch"]
    decay: Float[Array, "*batch"]
    rise_time_s: Float[Array, "*batch"]
    negative_pressure_pa: Float[Array, "*batch"]
    negative_duration_s: Float[Array, "*batch"]
    covariance: Float[Array, "*batch 4 4"]
    spread: Float[Array, "*batch 8"]
    found: Bool[Array, "*batch"]
    converged: Bool[Array, "*batch"]
    lower_bound: Bool[Array, "*batch"]
    clipped_at_pa: Float[Array, "*batch"]
    under_sampled: Bool[Array, "*batch"]
    sharp: Bool[Array, "*batch"]
    high_passed: Bool[Array, "*batch"]
    resonating: Bool[Array, "*batch"]
    drifting: Bool[Array, "*batch"]
    curving: Bool[Array, "*batch"]
    cut_short: Bool[Array, "*batch"]
    noise_known: Bool[Array, "*batch"]
    shifted: Bool[Array, "*batch"]
    front_alone: Bool[Array, "*batch"]
    resonance_hz: Float[Array, "*batch"]
    later_arrivals_s: Float[Array, "*batch later"]
    later_sigmas_s: Float[Array, "*batch later"]
    misfit: Float[Array, "*batch"]
    noise_pa: Float[Array, "*batch"]
    baseline_pa: Float[Array, "*batch"]
    form: Form

    def sd(self, name: str) -> Float[Array, "*batch"]:
        """Return the standard deviation of a value, in its own unit.

        Args:
            name: One of `NAMES`.

        Raises:
            ValueError: There is no such value.
        """
        if name not in NAMES:
            raise ValueError(f"expected one of {', '.join(NAMES)}, got {name}")
        sd = self.spread[..., NAMES.index(name)]
        if name in ("air_arrival_s", "decay"):
            return sd
        return sd * jnp.abs(getattr(self, name))


def pick(
    time_s: ArrayLike,
    pressure_pa: ArrayLike,
    *,
    full_scale_pa: float | None = None,
    high_pass_hz: float | None = None,
) -> Pick:
    """Return the pulses of records.

    The function is pure. Under `jit`, `vmap` and `grad` its input is not checked.

    Args:
        time_s: Middle of each sample on one even clock [s], [sample].
        pressure_pa: Overpressure [Pa], [*batch, sample]. In another unit, peak, impulse
            and suction are in that unit.
        full_scale_pa: Largest absolute value of a sample; samples at it are clipped.
            None if not specified: equal samples in a row at the extreme are clipped.
        high_pass_hz: Corner of the instrument's first-order high-pass [Hz].

    Returns:
        Arrival, peak, duration, impulse and more, with their covariance, for each
        record.

    Raises:
        InputError: Times are uneven or do not rise, lengths differ, a value is not
            finite, or a scale or corner is not positive.

    Example:
        `found = jblast.pick(time_s, pressure_pa)`, then `found.positive_impulse_pa_s`
        and `found.sd("positive_impulse_pa_s")`.
    """
    time, pressure = _checked(time_s, pressure_pa)
    n, batch = pressure.shape[-1], pressure.shape[:-1]
    step = (time[-1] - time[0]) / (n - 1)
    flat = pressure.reshape(-1, n)
    # NumPy pads without compiling a program for each length
    if filled_length(n) > n:
        pad = np.pad if isinstance(flat, np.ndarray) else jnp.pad
        flat = pad(flat, [(0, 0), (0, filled_length(n) - n)], mode="edge")
    for name, what, value, unit in (
        ("high_pass_hz", "a positive corner", high_pass_hz, "Hz"),
        ("full_scale_pa", "a positive pressure", full_scale_pa, "Pa"),
    ):
        if value is not None and not (0 < value < np.inf):
            raise InputError(f"{argument(name)}: expected {what}, got {value:g} {unit}")
    made = picks_of(
        flat,
        np.full(flat.shape[0], n),
        time[0],
        step,
        full_scale_pa,
        None if high_pass_hz is None else step * high_pass_hz,
    )
    return jax.tree.map(lambda x: x.reshape(*batch, *x.shape[1:]), made)


def _checked(time_s: ArrayLike, pressure_pa: ArrayLike):
    """Return checked times, in double precision unless traced, and samples."""
    pressure = (
        pressure_pa if isinstance(pressure_pa, Tracer) else np.asarray(pressure_pa)
    )
    time = time_s if isinstance(time_s, Tracer) else np.asarray(time_s, dtype=float)
    if time.ndim != 1:
        raise InputError(
            f"{argument('time_s')}: expected [sample], one clock for all records, got "
            f"the shape {time.shape}"
        )
    if pressure.ndim < 1 or time.shape[0] != pressure.shape[-1]:
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
    # samples of few bits (int16, float32) need the enabled precision all the same: the
    # search subtracts large numbers
    return time, pressure.astype(jax.dtypes.canonicalize_dtype(float))


def _check_even(time: Float[np.ndarray, " sample"]) -> None:
    """Raise an error if times are not finite, rising and even."""
    name = argument("time_s")
    if not np.all(np.isfinite(time)):
        first = int(np.argmax(~np.isfinite(time)))
        raise InputError(
            f"{name}: expected finite times, got {time[first]} at [{first}]"
        )
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
    # times written with few digits deviate by rounding, up to half a sample; a missing
    # sample deviates by more
    if (
        np.max(off) > max(CLOCK_TOLERANCE * step, 4e-16 * np.abs(time).max())
        and np.max(off) > 0.5 * step
    ):
        first = int(np.argmax(off))
        raise InputError(
            f"{name}: expected even steps of {step:.6g} s, got {time[first]:.9g} s at "
            f"[{first}], off by {off[first]:.3g} s"
        )


def filled_length(samples: int) -> int:
    """Return the length to which a record is padded."""
    return max(SHORTEST_PADDED, 1 << (samples - 1).bit_length())


def picks_of(
    samples: Float[Array, "lane sample"] | Float[np.ndarray, "lane sample"],
    counts: ArrayOrNumber,
    start: Float[ArrayOrNumber, "..."],
    step: Float[ArrayOrNumber, "..."],
    full_scale: Float[ArrayOrNumber, "..."] | None,
    high_pass: Float[ArrayOrNumber, "..."] | None,
) -> Pick:
    """Return the picks of records; each number is one for all or one per record.

    Args:
        samples: Samples of records of one length, padded with their last sample.
        counts: Number of samples of each.
        start: Time of the first sample [s].
        step: Sample interval [s].
        full_scale: Largest absolute value of a sample; None or NaN if not specified.
        high_pass: Corner of a first-order high-pass [cycles/sample]; None without one.
    """
    many, kind = jnp.shape(samples)[:1], samples.dtype

    def of_each(number):
        if isinstance(number, Tracer):
            return jnp.broadcast_to(number.astype(kind), many)
        return np.broadcast_to(np.asarray(number, kind), many)

    scale = of_each(np.nan if full_scale is None else full_scale)
    arrays = (samples, counts, of_each(start), of_each(step), scale)
    if high_pass is not None:
        arrays = (*arrays, of_each(2.0 * np.pi * high_pass))
    return in_chunks(_picks, arrays)


@kept
def _picks(samples, counts, start, step, full_scale, high_pass=None) -> Pick:
    """Pick records as `picks_of` does, with an array for each number."""
    scale = full_scale[:, None]
    by_scale = clipped_samples(samples, counts, scale)
    by_runs = clipped_samples(samples, counts, None)
    clipped = jnp.where(jnp.isnan(scale), by_runs, by_scale)
    return pick_of(pick_lanes(samples, clipped, counts, high_pass), start, step)


def pick_of(
    lanes: LanePicks, start: Float[Array, "..."], step: Float[Array, "..."]
) -> Pick:
    """Return picks in seconds and pascals.

    Args:
        lanes: Picks in samples.
        start: Time of the first sample [s].
        step: Sample interval [s].
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
    # the duration of a negative phase as shallow as the noise has no meaning
    deep = natural.suction * natural.suction_duration > DEEP_SUCTION * natural.impulse
    longer &= deep
    continued = lanes.form.negative == CONTINUED
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
        lower_bound=lanes.clipped & ~(spread[:, 1] < BOUND_PEAK_SD),
        clipped_at_pa=jnp.where(
            lanes.clipped, high, jnp.where(lanes.clipped_low, low, nan)
        ),
        under_sampled=natural.duration < FEW_SAMPLES,
        sharp=natural.rise < 1.0,
        high_passed=lanes.passed | (lanes.found & longer & ~continued),
        shifted=lanes.shifted,
        front_alone=lanes.front_alone,
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
        form=lanes.form,
    )


def in_chunks(made_of: Callable[..., Result], arrays: tuple[Any, ...]) -> Result:
    """Return a function of each record of a batch, evaluated in chunks of `LANES`.

    Args:
        made_of: Compiled function of a chunk; takes and returns arrays with a first
            axis of lanes. Results of padding lanes, which are zero, are discarded.
        arrays: Arguments for all records.
    """
    if any(isinstance(x, Tracer) for x in arrays):
        return made_of(*arrays)
    count = arrays[0].shape[0]
    # without records one chunk is evaluated for the shapes of the results
    chunks = max(-(-count // LANES), 1)
    filled = tuple(_filled(np.asarray(x), chunks) for x in arrays)
    devices = jax.devices()
    # dispatch is asynchronous: every device has work before any result is awaited
    parts = []
    for k in range(chunks):
        device = devices[k % len(devices)]
        parts.append(made_of(*(jax.device_put(x[k], device) for x in filled)))
    # NumPy concatenates without compiling a program for each number of records
    parts = jax.tree.map(np.asarray, parts)
    return jax.tree.map(lambda *x: jax.device_put(np.concatenate(x)[:count]), *parts)


def _filled(x: np.ndarray, chunks: int) -> np.ndarray:
    """Return lanes by chunk, padded with zeros."""
    none = np.zeros((chunks * LANES - x.shape[0], *x.shape[1:]), x.dtype)
    return np.concatenate([x, none]).reshape(chunks, LANES, *x.shape[1:])
