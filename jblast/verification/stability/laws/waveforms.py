"""Where Friedlander's pulse breaks: no decay, negative decay, too much impulse."""

import math

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.sensors.calculator import COMBINATIONS
from jblast.verification.stability.failure import FailureMode, verified
from jblast.verification.stability.threshold import crossing
from jblast.waves import (
    friedlander_decay,
    friedlander_impulse,
    friedlander_spectrum,
    kingery_bulmash_arrival_time,
    kingery_bulmash_duration,
    kingery_bulmash_impulse,
    kingery_bulmash_pressure,
    modified_friedlander_pressure,
)
from jblast.waves.waveform import blast_pressure

LOST = 1e-3
"""An impulse off by more than this has lost its digits [-]."""
METHOD = "Friedlander's pulse"


def wave_form_failures() -> list[FailureMode]:
    """Measure every failure mode of the pulse; impulses are over $P_s t_d$."""
    return [_near_zero(), _negative(), _rising_front(), _too_much_impulse()]


def closed_form(decay: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    r"""Return $1/b - (1 - e^{-b})/b^2$ as it stands, in the precision it comes in."""
    one = decay.dtype.type(1)
    return one / decay - (one - np.exp(-decay)) / (decay * decay)


def impulse_errors() -> tuple[
    Float[np.ndarray, " n"], Float[np.ndarray, " n"], Float[np.ndarray, " n"]
]:
    """Return decays, and the errors of the closed form and of ours in float32 there."""
    # single-precision numbers themselves, so that rounding b is no error
    single = np.geomspace(1e-6, 10.0, 2001).astype(np.float32)
    decay = single.astype(float)
    exact = np.asarray(friedlander_impulse(1.0, 1.0, decay))
    one = jnp.ones((), jnp.float32)
    ours = np.asarray(friedlander_impulse(one, one, jnp.asarray(single)))
    return decay, np.abs(closed_form(single) / exact - 1), np.abs(ours / exact - 1)


def _near_zero() -> FailureMode:
    decay, bare, ours = impulse_errors()
    boundary = float(decay[bare > LOST].max())

    def worst(low, high):
        return bare[(decay >= low) & (decay < high)].max()

    return FailureMode(
        area="wave forms",
        method=METHOD,
        failure="impulse in closed form, decay near 0, float32",
        boundary=boundary,
        unit="= b and below",
        beyond=f"{100 * LOST:g} % off there; near b = 0.001 up to "
        f"{100 * worst(9e-4, 1.1e-3):.0f} %, near 1e-6 up to {worst(0.0, 1.1e-6):.0e} "
        "times",
        response=verified("holds", bool(ours.max() < 1e-6), METHOD),
        message=f"expm1 and a series for |b| < 1: at most {ours.max():.0e} off in "
        "float32",
    )


def _negative() -> FailureMode:
    late = float(modified_friedlander_pressure(10.0, 1.0, 1.0, -0.5))
    try:
        friedlander_spectrum(1.0, 1.0, 1.0, 0.0)
    except ValueError as error:
        refusal = str(error)
    else:
        refusal = ""
    # where the peak of Kingery's and Bulmash's last stretch asks for a negative decay
    arrival = kingery_bulmash_arrival_time(38.0, 1.0, burst="free-air")
    duration = kingery_bulmash_duration(38.0, 1.0, burst="free-air")
    end = blast_pressure(arrival + 50.0 * duration, 38.0, 1.0, burst="free-air")
    ends = "decay must be positive" in refusal and float(end) == 0.0
    return FailureMode(
        area="wave forms",
        method=METHOD,
        failure="decay not positive: the tail grows without end",
        boundary=0.0,
        unit="= b and below",
        beyond=f"b = -0.5: {late:.0f} times the peak ten durations after arrival",
        response=verified("refuses", ends, METHOD),
        message="friedlander_spectrum refuses it; blast_pressure has the negative "
        "phase in place of the tail",
    )


def _rising_front() -> FailureMode:
    # the pressure is largest at t/t_d = 1 + 1/b, which is behind the front for b < -1
    decay = -2.0
    largest = float(modified_friedlander_pressure(1.0 + 1.0 / decay, 1.0, 1.0, decay))
    holds = COMBINATIONS["friedlander_decay"].holds
    marked = not holds(-1.0 - 1e-9) and bool(holds(-1.0 + 1e-9))
    fraction = float(friedlander_impulse(1.0, 1.0, -1.0))
    return FailureMode(
        area="wave forms",
        method=METHOD,
        failure="pressure rises behind the front",
        boundary=-1.0,
        unit="= b and below",
        beyond=f"impulse above {fraction:.3f} Ps td; b = -2: {largest:.2f} times the "
        "peak given",
        response=verified("marks", marked, METHOD),
        message="the decay is given, valid false: no such pulse has that peak",
    )


def conwep_decay(fraction: float) -> float:
    """Return the decay as programs after ConWep find it: Newton from $q - 1$.

    Of $b^2 = q (b - 1 + e^{-b})$ with $q = P_s t_d/i$, which $b = 0$ always solves.

    Args:
        fraction: Impulse over peak times duration [-].
    """
    q = 1.0 / fraction
    decay = q - 1.0
    for _ in range(100):
        slope = 2.0 * decay - q * (1.0 - math.exp(-decay))
        if slope == 0.0:
            break
        decay -= (decay**2 - q * (decay - 1.0 + math.exp(-decay))) / slope
    return decay


def _too_much_impulse() -> FailureMode:
    def fraction(z):
        of = {"slant_range": z, "charge_mass": 1.0, "burst": "free-air"}
        area = kingery_bulmash_pressure(**of) * kingery_bulmash_duration(**of)
        return float(kingery_bulmash_impulse(**of) / area)

    distance = crossing(lambda z: fraction(z) - 0.5, 20.0, 40.0)
    given = 0.6
    naive = conwep_decay(given)
    lost = float(friedlander_impulse(1.0, 1.0, naive)) / given - 1.0
    decay = float(friedlander_decay(1.0, given, 1.0))
    kept = float(friedlander_impulse(1.0, 1.0, decay)) / given - 1.0
    return FailureMode(
        area="wave forms",
        method=METHOD,
        failure="no decay >= 0 has the impulse",
        boundary=0.5,
        unit="= impulse/(Ps td) and above",
        beyond=f"kingery_bulmash in free air from Z = {distance:.1f} on; Newton as in "
        f"ConWep ends at b = {abs(naive):.0e}; at {given:g} the impulse is then "
        f"{100 * lost:+.0f} % off",
        response=verified("holds", abs(kept) < 1e-12, METHOD),
        message=f"the negative root, b = {decay:.2f} at {given:g}: impulse kept to "
        f"{max(abs(kept), 1e-16):.0e}",
    )
