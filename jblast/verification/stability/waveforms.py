"""Failure modes of Friedlander's pulse and of the shock solver.

Friedlander's pulse fails without decay, with negative decay, and for an impulse that is
too large for its peak and duration. The shock solver fails at long steps, on a coarse
grid, and where gas is torn apart.
"""

import itertools
import math
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.sensors.calculator import COMBINATIONS
from jblast.verification.stability.failure import (
    FailureMode,
    crossing,
    switching_point,
    verified,
)
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
from jblast.waves.euler import (
    Flow,
    FlowState,
    IdealGas,
    Primitives,
    decay_at,
    march,
    point_source_march,
    primitives,
    riemann_profile,
    run,
    simple_wave_means,
    start_simple_wave,
    start_sod,
    start_tube,
)
from jblast.waves.euler.initial import SOD_LEFT, SOD_RIGHT
from jblast.waves.euler.run import COURANT
from jblast.waves.euler.step import step
from jblast.waves.waveform import blast_pressure

# The usual resolution of Sod's tube: the error of the grid is small but measurable.
CELLS = 100
# Sod's tube at its usual end; the simple wave before its characteristics cross.
SOD_TIME, WAVE_TIME = 0.2, 1.5
"""End times of the two test problems [-]."""
SHORT_STEP = 0.1
"""Courant number at which the error is that of the grid alone."""
# Several times what the shortest step needs; bounds a run whose step shrinks to zero.
MAX_STEPS = 5000
"""Largest number of steps of one run."""
# Boundaries are printed to two digits.
BOUNDARY_TOLERANCE = 0.02
"""Relative precision of a boundary of the solver."""
SOUND = np.sqrt(1.4)
"""Speed of sound of a gas of unit density and pressure and gamma = 1.4."""
# Far below the scatter of measured impulses, far above the rounding of float32, 1e-7.
LOST_DIGITS = 1e-3
"""Largest accepted relative error of an impulse [-]."""
METHOD = "Friedlander's pulse"


def solver_failures() -> list[FailureMode]:
    """Measure every failure mode of the solver."""
    return [_unstable(), _inaccurate(), _coarse(), _torn()]


@eqx.filter_jit
def advance_barely(state: FlowState, flow: Flow, end, courant) -> FlowState:
    """Advance a flow to a time with any Courant number; none is refused."""

    def body(carry):
        state, count = carry
        return step(state, flow, courant, end)[0], count + 1

    def unfinished(carry):
        state, count = carry
        return (state.clock < end) & state.alive & (count < MAX_STEPS)

    return jax.lax.while_loop(unfinished, body, (state, jnp.asarray(0)))[0]


def sod_end(courant: float) -> tuple[bool, float]:
    """Return True if Sod's tube reached its end, and the L1 error of its density."""
    flow, state = start_sod(CELLS)
    end = advance_barely(state, flow, jnp.asarray(SOD_TIME), jnp.asarray(courant))
    left, right = (Primitives(*map(jnp.asarray, q)) for q in (SOD_LEFT, SOD_RIGHT))
    middles = 0.5 * (end.radius[1:] + end.radius[:-1])
    exact = riemann_profile(left, right, IdealGas(), middles / SOD_TIME)
    return bool(end.alive), _error(end, flow, exact.density)


def wave_error(courant: float) -> float:
    """Return the L1 error of the density of a smooth wave; infinite if it is lost."""
    flow, state = start_simple_wave(CELLS)
    end = advance_barely(state, flow, jnp.asarray(WAVE_TIME), jnp.asarray(courant))
    if not end.alive:
        return np.inf
    return _error(end, flow, simple_wave_means(end.radius, WAVE_TIME).density)


def _error(end: FlowState, flow: Flow, exact) -> float:
    error = jnp.abs(primitives(end, flow.gas).density - exact)
    return float(jnp.sum(error * jnp.diff(end.radius)))


def _refused(attempt: Callable[[], object]) -> bool:
    try:
        attempt()
    except InputError:
        return True
    return False


def _unstable() -> FailureMode:
    boundary = switching_point(lambda c: sod_end(c)[0], 0.7, 2.0, to=BOUNDARY_TOLERANCE)
    flow, state = start_sod(CELLS)

    def attempt(courant):
        return lambda: run(state, flow, 1e-3, records=1, courant=courant)

    refused = _refused(attempt(1.0 + 1e-9)) and not _refused(attempt(1.0))
    usual, at_limit = sod_end(COURANT)[1], sod_end(1.0)[1]
    return FailureMode(
        area="solver",
        method="explicit step, Sod's tube",
        failure="unstable",
        boundary=boundary,
        unit="stable steps and longer",
        beyond=f"positivity lost before the end; error at 1 is {at_limit / usual:.2f} "
        f"times that at {COURANT:g}",
        response=verified("refuses", refused and boundary > 1.0, "courant"),
        message="run and march refuse a fraction above 1",
    )


def _inaccurate() -> FailureMode:
    least = wave_error(SHORT_STEP)
    # at twice the error of the grid the step contributes as much as the grid
    boundary = crossing(
        lambda c: wave_error(c) / least - 2.0, SHORT_STEP, 1.0, to=BOUNDARY_TOLERANCE
    )
    limit, usual = wave_error(1.0) / least, wave_error(COURANT) / least
    return FailureMode(
        area="solver",
        method="explicit step, smooth wave",
        failure="the step costs as much accuracy as the grid",
        boundary=boundary,
        unit="stable steps and longer",
        beyond=f"error {limit:.1f} times that of short steps at 1, with {CELLS} cells",
        response=verified("holds", usual < 2.0 < limit, "usual step"),
        message=f"the default fraction is {COURANT:g}: {usual:.1f} times; up to 1 on "
        "request",
    )


def fewest_cells() -> int:
    """Return the least number of cells that a point source accepts."""

    def attempt(cells):
        return lambda: point_source_march(cells, 0.03)

    return next(n for n in itertools.count(1) if not _refused(attempt(n)))


def _coarse() -> FailureMode:
    fewest = fewest_cells()
    at = np.array([0.3, 1.0])
    fine = decay_at(at, point_source_march(4 * fewest, 1.01)).overpressure_ratio
    coarse = decay_at(at, point_source_march(fewest, 1.01)).overpressure_ratio
    error = 100.0 * (coarse / fine - 1.0)
    return FailureMode(
        area="solver",
        method="grid, point source",
        failure="too coarse to resolve the source",
        boundary=float(fewest - 1),
        unit="cells and fewer",
        beyond=f"with one more the pressure is {error[0]:+.2f} % off that of "
        f"{4 * fewest} cells at lambda = 0.3, {error[1]:+.2f} % at 1",
        response=verified("refuses", fewest > 1, "cells"),
        message=f"expects at least {fewest} cells; a sphere, 10",
    )


def torn(mach: float) -> str:
    """Return the message of `march` for a gas whose halves separate; "" if none.

    Args:
        mach: Mach number of each half, in opposite directions.
    """
    faces = jnp.linspace(-1.0, 1.0, 41)
    velocity = jnp.where(jnp.arange(40) < 20, -1.0, 1.0) * mach * SOUND
    filled = Primitives(jnp.ones(40), velocity, jnp.ones(40))
    flow, state = start_tube(faces, filled, IdealGas())
    return march(state, flow, 0.1 / (mach * SOUND), stride=1).lost


def _torn() -> FailureMode:
    boundary = switching_point(
        lambda m: bool(torn(m)), 0.05, 4.9, to=BOUNDARY_TOLERANCE
    )
    message = torn(1.1 * boundary)
    return FailureMode(
        area="solver",
        method="positivity, separating halves of a tube",
        failure="a pressure below zero",
        boundary=boundary,
        unit="Mach and above, each half",
        # vacuum at u = 2 c/(gamma - 1), which is Mach 5 at gamma = 1.4
        beyond="the scheme computes a pressure below zero; the exact flow has a vacuum "
        "from Mach 5 on",
        response=verified(
            "refuses", message.startswith("positivity lost at r ="), "march"
        ),
        message="march stops, reports radius and time, and returns the records until "
        "then",
    )


def wave_form_failures() -> list[FailureMode]:
    """Measure every failure mode of the pulse; impulses are over $P_s t_d$."""
    return [_near_zero(), _negative(), _rising_front(), _too_much_impulse()]


def closed_form(decay: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    r"""Return $1/b - (1 - e^{-b})/b^2$ as printed, in the precision of the input."""
    one = decay.dtype.type(1)
    return one / decay - (one - np.exp(-decay)) / (decay * decay)


def impulse_errors() -> tuple[
    Float[np.ndarray, " n"], Float[np.ndarray, " n"], Float[np.ndarray, " n"]
]:
    """Return decays, and the float32 errors of the closed form and of jblast there."""
    # decays that float32 represents exactly, so that rounding b is no error
    single = np.geomspace(1e-6, 10.0, 2001).astype(np.float32)
    decay = single.astype(float)
    exact = np.asarray(friedlander_impulse(1.0, 1.0, decay))
    one = jnp.ones((), jnp.float32)
    ours = np.asarray(friedlander_impulse(one, one, jnp.asarray(single)))
    return decay, np.abs(closed_form(single) / exact - 1), np.abs(ours / exact - 1)


def _near_zero() -> FailureMode:
    decay, bare, ours = impulse_errors()
    boundary = float(decay[bare > LOST_DIGITS].max())

    def worst(low, high):
        return bare[(decay >= low) & (decay < high)].max()

    return FailureMode(
        area="wave forms",
        method=METHOD,
        failure="impulse in closed form, decay near 0, float32",
        boundary=boundary,
        unit="= b and below",
        beyond=f"{100 * LOST_DIGITS:g} % off there; near b = 0.001 up to "
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
    # at this range peak, duration and impulse of Kingery-Bulmash need a negative decay
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
        message="friedlander_spectrum refuses it; blast_pressure replaces the tail by "
        "the negative phase",
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
        "stated peak",
        response=verified("marks", marked, METHOD),
        message="the decay is returned with valid false: this pulse has a higher peak",
    )


def conwep_decay(fraction: float) -> float:
    """Return the decay that programs after ConWep find: Newton from $q - 1$.

    The equation is $b^2 = q (b - 1 + e^{-b})$ with $q = P_s t_d/i$; $b = 0$ is always
    a solution.

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
        case = {"slant_range": z, "charge_mass": 1.0, "burst": "free-air"}
        area = kingery_bulmash_pressure(**case) * kingery_bulmash_duration(**case)
        return float(kingery_bulmash_impulse(**case) / area)

    # 0.5 is the impulse of a triangle, the limit of b = 0
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
