"""Fits a second of `fit_many`, and how many of them end elsewhere than they should.

The logs are those of `calibration.six_stations`. Starts are

- closed form: `inference.many.starts.closed_form`, from air minus ground arrivals;
  a doubtful end is tried again from draws of the prior;
- random: mass log-uniform from 1 to 1,000 kg, place uniform in a square of 200 m,
  origin time up to 0.1 s before the first reading. Each log has two; the second is
  used only if the end of the first is doubtful.

Where the time goes: the starts by themselves (a fit computes them in its loops, so they
are a part of it, not a sum beside it), what the tries after the first add, and what it
takes to bring readings from the host to the device and the answer back, which no rate
but that "from host to host" includes.

Beside it `scipy.optimize.least_squares`, method "lm" with the Jacobian, on some of the
same logs from the same starts, one by one; left out where there is no scipy.

Off the optimum is a log whose cost, in long double, exceeds the least one known by more
than 1e-9 (a likelihood ratio of 1 + 1e-9). The least is that of Gauss-Newton steps in
long double from the truth, or scipy's where that is less. A log says falsely that it
converged if it is off the optimum and flagged converged.
"""

import math
import os
import time
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from calibration.six_stations import (
    LAWS,
    Problem,
    columns_of,
    cost_of,
    draw,
    least_known,
    scene_of,
    scipy_ends,
)
from calibration.timing import best_of
from jblast.inference import ManyFits, fit_many
from jblast.inference.many.engine import engine_for
from jblast.sensors import planned_layout

LOGS = {"cpu": 1 << 17, "gpu": 1 << 23}
CHECKED = 10_000
LOOPED = 1000
REPEATS = 5
OFF = 1e-9


@jax.jit
def random_starts(key: PRNGKeyArray, readings: Float[Array, "log row"]):
    """Draw a start for each log."""
    mass, east, north, before = jax.random.uniform(key, (4, len(readings)))
    return jnp.stack(
        [
            math.log(1000) * mass,
            200 * east - 100,
            200 * north - 100,
            readings.min(axis=1) - 0.1 * before,
        ],
        axis=1,
    )


def fit_many_text() -> str:
    """Measure and return the tables."""
    with jax.enable_x64(True):
        return _text()


def _text() -> str:
    device = jax.devices()[0]
    platform = "cpu" if device.platform == "cpu" else "gpu"
    name = device.device_kind if platform == "gpu" else f"{os.cpu_count()} cores"
    problem = draw(LOGS[platform])
    uncertain = scene_of(problem)
    layout, sigma, _ = planned_layout(uncertain.scene)
    host, sigma = problem.readings[:, columns_of(layout)], np.asarray(sigma)
    readings = jnp.asarray(host)

    def drawn() -> Array:
        keys = jax.random.split(jax.random.key(1))
        return jnp.stack([random_starts(key, readings) for key in keys])

    def fit(starts=None, tries: int = 4, readings=readings) -> ManyFits:
        return fit_many(
            uncertain,
            layout,
            readings,
            sigma,
            LAWS,
            noise="gaussian",
            starts=starts,
            tries=tries,
        )

    engine = engine_for(uncertain, layout, LAWS, "gaussian")
    form = engine.form
    assert form is not None

    @jax.jit
    def straight(readings: Array) -> Array:
        return form.start(engine.rows, engine.rows.to_error_scale(readings)).T

    lines = [
        f"Fits a second: {platform}, {name}, {len(jax.devices())} devices of JAX "
        f"{jax.__version__}, {len(host):,} logs, float64"
    ]
    for title, start, whole, once in (
        ("closed form", lambda: straight(readings), fit, lambda: fit(tries=1)),
        ("random", drawn, lambda: fit(drawn()), lambda: fit(drawn(), tries=1)),
    ):
        given = start()
        seconds, answer = best_of(whole)
        without, _ = best_of(lambda given=given: fit(given))
        rate = len(host) / seconds
        lines += [
            "",
            f"starts: {title}",
            f"  fits/s, starts included           {rate:14,.0f}",
            f"  fits/s, starts given              {len(host) / without:14,.0f}",
            *correctness(problem, given, answer, rate),
            *times(seconds, best_of(once)[0], best_of(start)[0]),
        ]
    return "\n".join([*lines, *transfer(host, fit)])


def times(whole: float, once: float, start: float) -> list[str]:
    """Say where the seconds of a fit go."""
    return [
        f"  a fit of them all, ms             {1e3 * whole:14,.1f}",
        f"    the starts by themselves        {1e3 * start:14,.1f}"
        f"   ({start / whole:.0%} of it)",
        f"    what later tries add            {1e3 * (whole - once):14,.1f}"
        f"   ({1 - once / whole:.0%} of it)",
    ]


def transfer(host: np.ndarray, fit: Callable[..., ManyFits]) -> list[str]:
    """Say what it takes to bring readings to the device, and the answer back."""
    there, _ = best_of(lambda: jax.device_put(host))
    best, parts = math.inf, []
    for _ in range(REPEATS):
        answer = jax.block_until_ready(fit())  # a copy once made would be kept
        start = time.perf_counter()
        parts = jax.device_get(jax.tree.leaves(answer))
        best = min(best, time.perf_counter() - start)
    size = sum(np.asarray(x).nbytes for x in parts)
    both, _ = best_of(lambda: jax.device_get(jax.tree.leaves(fit(readings=host))))
    return [
        "",
        "from host to host, starts in closed form",
        f"  readings to the device, ms        {1e3 * there:14,.1f}"
        f"   ({host.nbytes / there / 1e9:.1f} GB/s)",
        f"  the whole answer back, ms         {1e3 * best:14,.1f}"
        f"   ({size / best / 1e9:.1f} GB/s)",
        f"  fits/s, both included             {len(host) / both:14,.0f}",
    ]


def correctness(
    problem: Problem, given: Array, answer: ManyFits, rate: float
) -> list[str]:
    """Say how many logs end off the optimum, ours and scipy's."""
    some = Problem(problem.stations, *(x[:CHECKED] for x in problem[1:]))
    few = Problem(problem.stations, *(x[:LOOPED] for x in problem[1:]))
    first = np.asarray(given if given.ndim == 2 else given[0])[:LOOPED]
    beside = scipy_ends(few, first)
    least = least_known(some)
    cost = cost_of(some, np.asarray(answer.z)[:CHECKED])
    known = np.minimum(least, np.fmin(cost, least))
    lines = ["  scipy lm with Jacobian            is not installed"]
    if beside is not None:
        theirs = cost_of(few, beside[1])
        known[:LOOPED] = np.fmin(known[:LOOPED], theirs)
        scipys_off = ~(theirs - known[:LOOPED] <= OFF)
        lines = [
            f"  scipy lm with Jacobian, fits/s    {beside[0]:14,.0f}"
            f"   ({rate / beside[0]:,.0f} times fewer)",
            f"  scipy, of {LOOPED:,}: off the optimum{scipys_off.sum():14,}",
        ]
    off = ~(cost - known <= OFF)
    said = np.asarray(answer.converged)[:CHECKED]
    return [
        f"  of {CHECKED:,}: off the optimum      {off.sum():14,}",
        f"  of {CHECKED:,}: say they converged   {said.sum():14,}",
        f"  of {CHECKED:,}: say so falsely       {(said & off).sum():14,}",
        f"  largest cost above the least      {np.nanmax(cost - known):14.1e}",
        f"  places tried, median and most     "
        f"{np.median(answer.steps):8.0f}{np.max(answer.steps):6.0f}",
        *lines,
    ]
