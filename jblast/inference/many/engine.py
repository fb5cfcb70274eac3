"""What fits logs of one layout: compiled once, and kept."""

import functools
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.errors import InputError
from jblast.inference.many.chunks import CompiledLoop
from jblast.inference.many.lanes import (
    LaneResults,
    better,
    doubtful,
    fitted_values,
    gather_lanes,
    lanes_where,
    scatter_lanes,
)
from jblast.inference.many.loop import Loop, with_effects
from jblast.inference.many.many_fits import ManyFits
from jblast.inference.many.residuals.readings import Readings, checked, faults_of, read
from jblast.inference.many.residuals.rows import LaneRows, rows_of
from jblast.inference.many.solver.levenberg_marquardt import LaneLevenbergMarquardt
from jblast.inference.many.solver.normal_equations import MOST_UNKNOWNS
from jblast.inference.many.solver.quadratic_model import half_square
from jblast.inference.many.starts.multilateration import closed_form
from jblast.inference.many.starts.nearest_prior_draw import ReferenceSet, reference_set
from jblast.inference.many.starts.tries import Starts, given_starts
from jblast.inference.posterior.parameters import parameters_of
from jblast.inference.posterior.posterior import Posterior
from jblast.scene import UncertainScene
from jblast.sensors import Layout
from jblast.sensors.law_choice import settled
from jblast.sensors.simulate import Noise

KEPT = 16
"""Layouts whose compiled programs are kept."""
STRAGGLERS = 0.02
"""A loop does not wait for this share of its logs; they go on together later."""
TOGETHER = 1024
"""Not more logs than this go through all their other tries at once."""

_ENGINES: dict[Any, "Engine"] = {}


def engine_for(
    uncertain: UncertainScene,
    layout: Layout,
    laws: Mapping[str, str],
    noise: Noise,
    devices: int | None = None,
) -> "Engine":
    """Return what fits logs of a layout; compiled once for each."""
    leaves, tree = jax.tree.flatten((uncertain, layout))
    arrays = [np.asarray(leaf) for leaf in leaves]
    key = (
        str(tree),
        tuple((a.dtype.str, a.shape, a.tobytes()) for a in arrays),
        tuple(sorted(laws.items())),
        noise,
        jnp.zeros(()).dtype.str,
        devices,
    )
    if key not in _ENGINES:
        scene, layout = settled(uncertain.scene, layout)
        parameters = parameters_of(replace(uncertain, scene=scene))
        if not parameters.names:
            raise InputError("nothing to fit: every number of the scene is fixed")
        rows = rows_of(parameters, layout, laws, noise)
        if rows.unknowns > MOST_UNKNOWNS:
            raise InputError(
                f"{len(parameters.names)} free numbers and {rows.effects} effects that "
                f"rows share: expected at most {MOST_UNKNOWNS} together; fit such logs "
                "one by one"
            )
        while len(_ENGINES) >= KEPT:
            del _ENGINES[next(iter(_ENGINES))]
        _ENGINES[key] = Engine(rows, devices)
    return _ENGINES[key]


class Engine:
    """Fits logs of one layout, compiled once for each size of batch."""

    def __init__(self, rows: LaneRows, devices: int | None = None) -> None:
        self.rows, self.devices = rows, devices
        plain = rows.noise == "gaussian" and not rows.varies
        loss = half_square if plain else rows.loss
        self.solver = LaneLevenbergMarquardt(loss=loss, jacobian="aux")
        self.form = closed_form(rows)
        self.read = jax.jit(functools.partial(read, rows))
        self.doubtful = jax.jit(
            functools.partial(doubtful, rows.noise, len(rows.layout.quantity))
        )
        self.fitted_values = jax.jit(functools.partial(fitted_values, rows))
        self.compiled: dict[Any, CompiledLoop] = {}
        self.reference_sets: dict[Any, ReferenceSet] = {}

    def fit(
        self, values, sigma, *, starts, tries: int, seed: int, again_z: float
    ) -> ManyFits:
        """Fit logs; see `fit_many`."""
        rows = self.rows
        values, sigma = checked(rows.layout, values, sigma)
        readings = self.read(values, sigma)
        compiled = self._compiled(sigma)
        if starts is not None:
            starts = given_starts(starts, len(values), len(rows.parameters.names))
            tries = min(tries, len(starts))
        given = starts is not None
        where = Starts(
            starts,
            self.form is not None and not given,
            lambda: self._reference_set(sigma, seed),
        )
        z = where.first(readings.measured)
        y = None if z is None else with_effects(rows, z)
        best = self._ended(compiled, y, readings)
        left = range(1, tries)
        best = self._again(compiled, where, best, readings, left, again_z, None)
        z, covariance, numbers, cost, misfit = self.fitted_values(best, readings.bad)
        return ManyFits(
            names=rows.parameters.names,
            z=z,
            values=numbers,
            cost=cost,
            misfit=misfit,
            covariance=covariance,
            converged=best.converged,
            doubtful=self.doubtful(best, readings.bad),
            tolerance=best.tolerance,
            steps=best.steps,
            bad=readings.bad,
            faults=faults_of(rows.layout, values, sigma, readings.bad),
        )

    def straight(
        self, values: Float[Array, "log row"] | Float[np.ndarray, "log row"]
    ) -> Float[Array, "log free"]:
        """Return the starts in closed form.

        Raises:
            InputError: The closed form does not apply to this layout.
        """
        if self.form is None:
            raise InputError("expected a layout to which the closed form applies")
        return self.form.start(
            self.rows, self.rows.to_error_scale(jnp.asarray(values))
        ).T

    def _solve(
        self,
        compiled: CompiledLoop,
        y: Array | None,
        readings: Readings,
        times: int = 3,
    ) -> LaneResults:
        """Solve all lanes but for stragglers, then these, and wait for the last."""
        results = compiled.run(y, readings, STRAGGLERS if times else 0.0)
        lanes = lanes_where(~results.done) if times else np.zeros(0, int)
        if lanes.size == 0:
            return results
        left = gather_lanes(results, lanes)
        again = self._solve(compiled, left.y, gather_lanes(readings, lanes), times - 1)
        return scatter_lanes(
            results, again._replace(steps=again.steps + left.steps), lanes
        )

    def _ended(
        self, compiled: CompiledLoop, y: Array | None, readings: Readings
    ) -> LaneResults:
        """Solve all lanes; go on by the whole curvature where that does not end."""
        results = self._solve(compiled, y, readings)
        lanes = lanes_where(~(results.converged | readings.bad))
        if lanes.size == 0:
            return results
        few, some = gather_lanes(results, lanes), gather_lanes(readings, lanes)
        again = self._solve(compiled, compiled.onwards(few.y, some), some)
        again = again._replace(steps=again.steps + few.steps)
        return scatter_lanes(results, better(few, again), lanes)

    def _again(
        self,
        compiled: CompiledLoop,
        where: Starts,
        best: LaneResults,
        readings: Readings,
        tries: range,
        again_z: float,
        logs: np.ndarray | None,
    ) -> LaneResults:
        """Start again where a result is doubtful; the lowest of each log counts."""
        if not tries:
            return best
        lanes = lanes_where(self.doubtful(best, readings.bad, again_z))
        if lanes.size == 0:
            return best
        logs = lanes if logs is None else logs[lanes]
        few, some = gather_lanes(best, lanes), gather_lanes(readings, lanes)
        # a loop over few lanes takes as long as its slowest, however many they are
        now = len(tries) if lanes.size <= TOGETHER else 1
        z = [where.at(which, some.measured, logs) for which in tries[:now]]
        y = with_effects(self.rows, jnp.concatenate(z, axis=1))
        results = self._ended(compiled, y, gather_lanes(readings, np.tile(lanes, now)))
        for one in np.split(np.arange(now * lanes.size), now):
            few = better(few, gather_lanes(results, one))
        few = self._again(compiled, where, few, some, tries[now:], again_z, logs)
        return scatter_lanes(best, few, lanes)

    def _compiled(self, sigma) -> CompiledLoop:
        """Return what runs lanes with these errors; they are constants of it."""
        fixed = sigma[:, None] if isinstance(sigma, np.ndarray) else None
        key = None if fixed is None else fixed.tobytes()
        if key not in self.compiled:
            self.compiled[key] = CompiledLoop(
                Loop(self.rows, self.solver, self.form, fixed), self.devices
            )
        return self.compiled[key]

    def _reference_set(self, sigma, seed: int) -> ReferenceSet:
        """Return the reference set, drawn once."""
        typical = np.asarray(sigma)
        if typical.ndim == 2:
            typical = np.nanmedian(np.where(typical >= 0, typical, np.nan), axis=0)
        key = seed, typical.tobytes()
        if key not in self.reference_sets:
            layout = self.rows.layout
            blank = Posterior(
                self.rows.parameters,
                layout,
                jnp.zeros(len(layout.quantity)),
                jnp.asarray(typical),
                self.rows.laws,
                self.rows.noise,
            )
            key_of_draws = jax.random.key(seed)
            self.reference_sets[key] = reference_set(
                key_of_draws, blank, self.rows, typical
            )
        return self.reference_sets[key]
