"""Where derivatives break: at the arrival of a sharp front, and at distance zero."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.errors import InputError
from jblast.observations import observed, resolve_positions
from jblast.registry import LAWS, call
from jblast.scene import Charge, Scene
from jblast.sensors.calculator import calculated_laws, scene_path, with_rows
from jblast.verification.stability.failure import FailureMode, verified
from jblast.waves import (
    finite_rise_pressure,
    modified_friedlander_pressure,
    slant_range,
)

DURATION, DECAY = 10e-3, 1.5
"""Of the pulse [s], [-]; its peak is 1."""
RATE = 1e5
"""Samples a second of its record [Hz]."""
MISPLACED = 1.3335e-3
"""By how much the arrival is taken too late [s]; it lies between two samples."""
MOST_SAMPLES = 20
"""In the longest rise that is tried."""
UNFELT = 0.05
"""A slope off by more than this is called wrong [-]."""


def gradient_failures() -> list[FailureMode]:
    """Measure every failure mode of a derivative."""
    return [_front(), _misfit(), _distance(), _laws_at_zero()]


def pulse(
    time: Float[Array, "..."], rise_time: Float[Array, ""] | None = None
) -> Float[Array, "..."]:
    """Return the pulse, sharp or with a rise [s]."""
    if rise_time is None:
        return modified_friedlander_pressure(time, 1.0, DURATION, DECAY)
    return finite_rise_pressure(time, 1.0, DURATION, DECAY, rise_time)


@jax.jit
def misfit_slopes(
    rise_time: Float[Array, ""] | None = None,
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return d(misfit)/d(arrival) by JAX and by differences over many samples [1/s].

    The misfit is the mean square over a record whose true arrival is `MISPLACED`
    earlier.
    """
    time = jnp.arange(0.0, 0.05, 1.0 / RATE)
    record = pulse(time - 0.02, rise_time)

    def misfit(arrival):
        return jnp.mean((pulse(time - arrival, rise_time) - record) ** 2)

    arrival, step = 0.02 + MISPLACED, 20.0 / RATE
    difference = (misfit(arrival + step) - misfit(arrival - step)) / (2.0 * step)
    return jax.grad(misfit)(arrival), difference


def slope_felt(samples: int) -> float:
    """Return how much of the misfit's slope JAX sees [-].

    Args:
        samples: Of the record in the rise of the front; 0 for a sharp one.
    """
    felt, true = misfit_slopes(jnp.asarray(samples / RATE) if samples else None)
    return float(felt / true)


def _front() -> FailureMode:
    slope = jax.grad(lambda t: pulse(t))
    before, at, after = (float(slope(t)) for t in (-1e-9, 0.0, 1e-9))
    rise = jnp.asarray(1e-4)
    soft = [float(jax.grad(lambda t: pulse(t, rise))(t)) for t in (-1e-9, 0.0)]
    step = 1e-6
    secant = float(pulse(jnp.asarray(step)) - pulse(jnp.asarray(-step))) / (2 * step)
    inside = before == 0.0 and np.isclose(at, after, rtol=1e-5) and soft == [0.0, 0.0]
    return FailureMode(
        area="gradients",
        method="sharp front, slope in time",
        failure="no derivative at the arrival",
        boundary=0.0,
        unit="s after arrival",
        beyond=f"{before:g} Ps/s before, {at:.0f} at it and after; differences over "
        f"{2e6 * step:g} us: {secant:+.0f}",
        response=verified("holds", bool(inside), "slope at the arrival"),
        message="pressure and slope at the arrival are those behind the front, finite; "
        "finite_rise_pressure has one slope from both sides",
    )


def _misfit() -> FailureMode:
    sharp, soft = slope_felt(0), slope_felt(MOST_SAMPLES)
    samples = np.arange(1, MOST_SAMPLES + 1)
    off = np.array([abs(slope_felt(int(n)) - 1.0) for n in samples])
    return FailureMode(
        area="gradients",
        method="sharp front, misfit of a record",
        failure="moving the arrival over a sample is not felt",
        boundary=float(samples[off > UNFELT].max()),
        unit="samples of rise and fewer",
        beyond=f"sharp: d(misfit)/d(arrival) is {100 * sharp:.0f} % of what it is",
        response=verified("holds", abs(soft - 1.0) < UNFELT, "misfit of a record"),
        message=f"finite_rise_pressure: {100 * soft:.0f} % with {MOST_SAMPLES} samples "
        "in the rise",
    )


def _distance() -> FailureMode:
    origin = jnp.zeros(3)
    naive = jax.grad(jnp.linalg.norm)(origin)
    ours = jax.grad(slant_range)(origin, jnp.zeros(3))
    defined = bool(jnp.isnan(naive).all()) and bool((ours == 0.0).all())
    return FailureMode(
        area="gradients",
        method="slant range, slope in place",
        failure="no direction at distance 0",
        boundary=0.0,
        unit="m",
        beyond="the root of the sum of squares has NaN for slope, and so all it enters",
        response=verified("holds", defined, "slant range at 0"),
        message="slant_range gives 0",
    )


def _laws_at_zero() -> FailureMode:
    bad = laws_without_slope()
    refused = 0
    at_zero = np.zeros((1, 3))
    peak = ["a"], ["peak_overpressure_pa"], [1e4], [1e3]
    log = observed(*peak, position=at_zero)
    pressure = LAWS["peak_overpressure_pa", "kingery_bulmash"].function
    for refuse in (lambda: pressure(0.0, 1.0), lambda: resolve_positions(log, Scene())):
        try:
            refuse()
        except (InputError, ValueError):
            refused += 1
    return FailureMode(
        area="gradients",
        method="laws of the slant range",
        failure="no blast at distance 0",
        boundary=0.0,
        unit="m",
        beyond=f"inside jit {len(bad)} of {len(_laws_of_range())} laws have no finite "
        "value with a finite slope there",
        response=verified("refuses", refused == 2, "distance 0"),
        message="outside jit a law raises; fit, bound and simulate refuse a sensor "
        "that stands on the charge",
    )


def laws_without_slope() -> list[str]:
    """Name the laws whose value or slope inside jit is not finite at distance 0."""
    path = scene_path(Scene(charge=Charge(mass_kg=1.0)))

    def values(distance):
        way = with_rows(path, distance[None], jnp.ones(1))
        return jnp.stack([jnp.sum(call(law.function, way)) for law in _laws_of_range()])

    zero = jnp.zeros(())
    both = jax.jit(lambda x: jax.jvp(values, (x,), (jnp.ones(()),)))(zero)
    finite = np.isfinite(both).all(axis=0)
    return [
        f"{law.quantity} by {law.name}"
        for law, good in zip(_laws_of_range(), finite, strict=True)
        if not good
    ]


def _laws_of_range():
    return [law for law in calculated_laws() if "slant_range" in law.arguments()]
