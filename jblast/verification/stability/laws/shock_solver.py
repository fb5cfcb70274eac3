"""Where the shock solver breaks: long steps, a coarse grid, gas torn apart."""

import itertools
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jblast.errors import InputError
from jblast.verification.stability.failure import FailureMode, verified
from jblast.verification.stability.threshold import crossing, switching_point
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

CELLS = 100
SOD_TIME, WAVE_TIME = 0.2, 1.5
"""When Sod's tube [1] and the simple wave are looked at."""
SHORT = 0.1
"""A fraction of the largest stable step whose error is that of the grid alone."""
MOST_STEPS = 5000
CLOSE = 0.02
"""Edges are found to this, relative."""
SOUND = np.sqrt(1.4)
"""Speed of sound of the gas that is torn apart, of density and pressure 1."""


def solver_failures() -> list[FailureMode]:
    """Measure every failure mode of the solver."""
    return [_unstable(), _inaccurate(), _coarse(), _torn()]


@eqx.filter_jit
def advance_barely(state: FlowState, flow: Flow, end, courant) -> FlowState:
    """Step to an end with any fraction of the largest stable step: none is refused."""

    def body(carry):
        state, count = carry
        return step(state, flow, courant, end)[0], count + 1

    def goes_on(carry):
        state, count = carry
        return (state.clock < end) & state.alive & (count < MOST_STEPS)

    return jax.lax.while_loop(goes_on, body, (state, jnp.asarray(0)))[0]


def sod_end(courant: float) -> tuple[bool, float]:
    """Return whether Sod's tube came to its end, and the L1 error of its density."""
    flow, state = start_sod(CELLS)
    end = advance_barely(state, flow, jnp.asarray(SOD_TIME), jnp.asarray(courant))
    left, right = (Primitives(*map(jnp.asarray, q)) for q in (SOD_LEFT, SOD_RIGHT))
    middles = 0.5 * (end.radius[1:] + end.radius[:-1])
    exact = riemann_profile(left, right, IdealGas(), middles / SOD_TIME)
    return bool(end.alive), _error(end, flow, exact.density)


def wave_error(courant: float) -> float:
    """Return the L1 error of a smooth wave's density; infinite if it was lost."""
    flow, state = start_simple_wave(CELLS)
    end = advance_barely(state, flow, jnp.asarray(WAVE_TIME), jnp.asarray(courant))
    if not end.alive:
        return np.inf
    return _error(end, flow, simple_wave_means(end.radius, WAVE_TIME).density)


def _error(end: FlowState, flow: Flow, exact) -> float:
    off = jnp.abs(primitives(end, flow.gas).density - exact)
    return float(jnp.sum(off * jnp.diff(end.radius)))


def _refused(attempt: Callable[[], object]) -> bool:
    try:
        attempt()
    except InputError:
        return True
    return False


def _unstable() -> FailureMode:
    boundary = switching_point(lambda c: sod_end(c)[0], 0.7, 2.0, to=CLOSE)
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
    least = wave_error(SHORT)
    boundary = crossing(lambda c: wave_error(c) / least - 2.0, SHORT, 1.0, to=CLOSE)
    limit, usual = wave_error(1.0) / least, wave_error(COURANT) / least
    return FailureMode(
        area="solver",
        method="explicit step, smooth wave",
        failure="the step costs as much accuracy as the grid",
        boundary=boundary,
        unit="stable steps and longer",
        beyond=f"error {limit:.1f} times that of short steps at 1, with {CELLS} cells",
        response=verified("holds", usual < 2.0 < limit, "usual step"),
        message=f"the usual fraction is {COURANT:g}: {usual:.1f} times; up to 1 if "
        "asked",
    )


def fewest_cells() -> int:
    """Return with how many cells a point source is not refused any more."""

    def attempt(cells):
        return lambda: point_source_march(cells, 0.03)

    return next(n for n in itertools.count(1) if not _refused(attempt(n)))


def _coarse() -> FailureMode:
    fewest = fewest_cells()
    at = np.array([0.3, 1.0])
    fine = decay_at(at, point_source_march(4 * fewest, 1.01)).overpressure_ratio
    coarse = decay_at(at, point_source_march(fewest, 1.01)).overpressure_ratio
    off = 100.0 * (coarse / fine - 1.0)
    return FailureMode(
        area="solver",
        method="grid, point source",
        failure="too coarse to hold the source",
        boundary=float(fewest - 1),
        unit="cells and fewer",
        beyond=f"with one more the pressure is {off[0]:+.2f} % off that of "
        f"{4 * fewest} cells at lambda = 0.3, {off[1]:+.2f} % at 1",
        response=verified("refuses", fewest > 1, "cells"),
        message=f"expects at least {fewest} cells; a sphere, 10",
    )


def torn(mach: float) -> str:
    """Return what `march` says of gas whose halves part, each at a Mach number."""
    faces = jnp.linspace(-1.0, 1.0, 41)
    velocity = jnp.where(jnp.arange(40) < 20, -1.0, 1.0) * mach * SOUND
    filled = Primitives(jnp.ones(40), velocity, jnp.ones(40))
    flow, state = start_tube(faces, filled, IdealGas())
    return march(state, flow, 0.1 / (mach * SOUND), stride=1).lost


def _torn() -> FailureMode:
    boundary = switching_point(lambda m: bool(torn(m)), 0.05, 4.9, to=CLOSE)
    said = torn(1.1 * boundary)
    return FailureMode(
        area="solver",
        method="positivity, halves of a tube torn apart",
        failure="a pressure below zero",
        boundary=boundary,
        unit="Mach and above, each half",
        beyond="the scheme finds a pressure below zero; the exact flow opens a vacuum "
        "at Mach 5 only",
        response=verified(
            "refuses", said.startswith("positivity lost at r ="), "march"
        ),
        message="march stops there, says where and when, and keeps the records until "
        "then",
    )
