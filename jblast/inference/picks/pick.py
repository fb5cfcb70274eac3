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
from jaxtyping import ArrayLike, Float

from jblast.errors import InputError, argument
from jblast.inference.picks.in_units import filled_length, picks_of
from jblast.inference.picks.result import Pick

LEAST_SAMPLES = 16
UNEVEN = 1e-3
"""Times are even where none is farther off than this share of a sample (and of the
digits that they are written in)."""


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
        InputError: Times are not even or do not rise, lengths do not fit, a value is
            not finite, or a scale or corner is not positive.

    Example:
        `found = jblast.pick(time_s, pressure_pa)`, then `found.positive_impulse_pa_s`
        and `found.sd("positive_impulse_pa_s")`.
    """
    time, pressure = _checked(time_s, pressure_pa)
    n, batch = pressure.shape[-1], pressure.shape[:-1]
    step = (time[-1] - time[0]) / (n - 1)
    flat = pressure.reshape(-1, n)
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
    """Return times, in double precision if they are numbers, and samples; or refuse."""
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
    # in the widest precision there is: a record in few bits is no reason for less
    return time, pressure.astype(jax.dtypes.canonicalize_dtype(float))


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
