"""The compiled program that fits logs of one layout.

One loop fits a block of lanes by Levenberg-Marquardt and evaluates the covariance and
convergence of each result. A batch of any size is cut into blocks, over all devices,
and compiled once for each size of block. A loop does not wait for its slowest lanes:
a share of stragglers is collected, and continued together. Lanes that Gauss-Newton does
not end are continued by Newton's method, and doubtful ones are tried again from other
starts. Programs are kept for the `KEPT` latest layouts.
"""

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jax.sharding import AxisType, PartitionSpec
from jaxtyping import Array, Float

from jblast.errors import InputError
from jblast.inference.many.lanes import (
    LaneResults,
    ManyFits,
    better,
    beyond_array,
    doubtful,
    fitted_values,
    gather_lanes,
    lanes_where,
    scatter_lanes,
)
from jblast.inference.many.residuals import (
    LaneRows,
    Readings,
    checked,
    faults_of,
    read,
    rows_of,
)
from jblast.inference.many.solver import (
    MAX_UNKNOWNS,
    Expansion,
    LaneLevenbergMarquardt,
    Triangle,
    cholesky,
    expansion,
    half_square,
    inverse_of,
    newton,
    triangle,
)
from jblast.inference.many.starts import (
    ClosedForm,
    ReferenceSet,
    Starts,
    closed_form,
    given_starts,
    reference_set,
)
from jblast.inference.posterior.parameters import parameters_of
from jblast.inference.posterior.posterior import Posterior
from jblast.scene import UncertainScene
from jblast.sensors import Layout
from jblast.sensors.law_choice import settled
from jblast.sensors.simulated_readings import Noise

KEPT = 16
"""Largest number of layouts whose compiled programs are kept: each holds its programs
in memory."""
STRAGGLERS = 0.02
"""Share of its logs for which a loop does not wait. They are collected and continued
together: without that every loop takes as long as its slowest log."""
RETRY_LOGS = 1024
"""Largest number of logs whose remaining starts are tried simultaneously: for few logs
one loop costs less than several, for many the first retry settles most."""
_ENGINES: dict[Any, "Engine"] = {}  # in the order of their creation
# Lanes that have not converged by then are continued by Newton's method.
MAX_STEPS = 200
Inputs = tuple[Float[Array, "unknown lane"] | None, Readings]
"""Starts of lanes (None for the closed form) and their readings."""
LANES = {"cpu": (16, 128), "gpu": (1 << 10, 1 << 14, 1 << 18, 1 << 20)}
"""Numbers of lanes of one loop by platform; the smallest sufficient one is used. On a
CPU the arrays of 128 lanes fit into its cache, a GPU needs many lanes to be busy."""
CHUNKS = {"cpu": 128, "gpu": 1}
"""Loops of one call of the compiled program on each device: fewer calls from Python."""


def engine_for(
    uncertain: UncertainScene,
    layout: Layout,
    laws: Mapping[str, str],
    noise: Noise,
    devices: int | None = None,
) -> "Engine":
    """Return the engine that fits logs of a layout; compiled once for each."""
    leaves, tree = jax.tree.flatten((uncertain, layout))
    arrays = [np.asarray(leaf) for leaf in leaves]
    # all values, not only shapes: positions and fixed numbers are constants of the
    # program
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
        if rows.unknowns > MAX_UNKNOWNS:
            raise InputError(
                f"expected at most {MAX_UNKNOWNS} free numbers and shared effects, got "
                f"{len(parameters.names)} and {rows.effects}; fit such logs one by one"
            )
        while len(_ENGINES) >= KEPT:  # the oldest first
            del _ENGINES[next(iter(_ENGINES))]
        _ENGINES[key] = Engine(rows, devices)
    return _ENGINES[key]


@dataclass(frozen=True)
class Loop:
    """A loop that fits lanes of one layout.

    Attributes:
        rows: Rows of the layout.
        solver: Solver with the loss of these rows.
        form: Closed form of starts, if it applies.
        sigma: Instrument errors if all logs have the same.
    """

    rows: LaneRows
    solver: LaneLevenbergMarquardt
    form: ClosedForm | None
    sigma: Float[np.ndarray, "row 1"] | None

    def fit(self, stragglers: Float[Array, ""], lanes: Inputs) -> LaneResults:
        """Fit lanes until all but a share of stragglers have ended."""
        y, (measured, errors, bad) = lanes
        if y is None:
            # inside of the loop, while the readings of the block are in the cache
            y = self._begin(measured)
        sigma = self._sigma(errors)
        bad = bad | ~jnp.isfinite(y).all(axis=0)
        # bad lanes are computed, too, and must not produce NaN in shared reductions
        y = jnp.where(jnp.isfinite(y), y, 0.0)
        floor = self._floor(measured, sigma)
        options = {"floor": floor, "skip": bad, "stragglers": stragglers}

        def residuals(y, args):
            return self.rows.miss(y, args[0], self._sigma(args[1]))

        found = optx.least_squares(
            residuals,
            self.solver,
            y,
            (measured, errors),
            options=options,
            has_aux=True,
            max_steps=MAX_STEPS,
            throw=False,
        )
        state, free = found.state, len(self.rows.parameters.names)
        true, misfit, known = self._end(found.value, state.info, measured, sigma, floor)
        # The gradient is judged by the solver's curvature, which is positive; at a
        # maximum or saddle the true one is not.
        converged = self.solver.at_optimum(state.info) & cholesky(true.hessian).positive
        factor = cholesky(known)
        columns = inverse_of(factor)
        covariance = jnp.stack([jnp.stack(c[:free]) for c in columns[:free]])
        return LaneResults(
            y=found.value,
            cost=true.f,
            misfit=misfit,
            covariance=jnp.where(factor.positive, covariance, jnp.nan),
            converged=converged & jnp.isfinite(true.f) & ~bad,
            tolerance=jnp.sqrt(self.solver.square_tolerance(state.info)),
            steps=state.steps,
            done=state.done | bad,
        )

    def onwards(
        self, y: Float[Array, "unknown lane"], readings: Readings
    ) -> Float[Array, "unknown lane"]:
        """Continue lanes by Newton's method."""
        measured, errors, bad = readings
        sigma = self._sigma(errors)
        good = ~bad & jnp.isfinite(y).all(axis=0)

        def cost(y):
            miss = self.rows.miss(y, measured, sigma)
            value, slope, _ = self.solver.loss(miss.residual)
            gradient = [jnp.sum(column * slope, axis=0) for column in miss.columns]
            return jnp.sum(value, axis=0), jnp.stack(gradient)

        first = jnp.where(good, y, 0.0)
        floor = self._floor(measured, sigma)
        f = cost(first)[0]
        slack = floor * (jnp.sqrt(2 * jnp.abs(f)) + floor)
        return jnp.where(good, newton(cost, first, slack), y)

    def _floor(self, measured, sigma) -> Float[Array, " lane"]:
        """Return the rounding error of the length of the vector of residuals."""
        # the rounding error of a residual is that of the reading's last digit
        scale = jnp.where(sigma > 0, sigma, 1.0)  # 0: only the law's scatter
        eps = jnp.finfo(measured.dtype).eps
        return eps * jnp.sqrt(jnp.sum(jnp.square(measured / scale), axis=0))

    def _sigma(self, errors: Array | None) -> Array | np.ndarray:
        """Return the instrument errors; constants if all logs have the same."""
        sigma = self.sigma if errors is None else errors
        assert sigma is not None
        return sigma

    def _begin(
        self, measured: Float[Array, "row lane"]
    ) -> Float[Array, "unknown lane"]:
        """Return the starts of lanes in closed form."""
        assert self.form is not None
        z = self.form.start(self.rows, measured)
        return with_effects(self.rows, z)

    def _end(
        self, y, info: Expansion, measured, sigma, floor
    ) -> tuple[Expansion, Float[Array, " lane"], Triangle]:
        """Return the true expansion at an end, the misfit, and the information."""
        rows, loss = self.rows, self.rows.loss
        if self.solver.loss is half_square:
            # for normal errors of fixed size the last expansion of the solver is exact
            return info, info.f, info.hessian
        miss = rows.miss(y, measured, sigma)
        true = expansion(loss.true, y, *miss, floor)
        misfit = jnp.sum(loss(miss.residual)[0][: rows.scored], axis=0)
        known = rows.miss(y, measured, sigma, sd_known=True) if rows.varies else miss
        return true, misfit, triangle(known.columns, loss.information(known.residual))


class CompiledLoop:
    """Runs lanes through one loop's program, compiled for each size of block."""

    def __init__(self, loop: Loop, devices: int | None = None) -> None:
        self.loop, self.devices = loop, devices
        self.programs: dict[tuple[int, int], Callable[..., LaneResults]] = {}
        self.onwards = jax.jit(loop.onwards)

    def run(
        self,
        y: Float[Array, "unknown lane"] | None,
        readings: Readings,
        stragglers: float,
    ) -> LaneResults:
        """Fit lanes until all but a share of stragglers in each loop have ended.

        Args:
            y: Starts; None for the closed form.
            readings: Readings of the lanes.
            stragglers: Share of stragglers.
        """
        count = readings.bad.size
        # the smallest size of block that suffices: each size compiles a program
        devices = self.devices or len(jax.devices())
        platform = "cpu" if jax.default_backend() == "cpu" else "gpu"
        share = -(-count // devices)
        each = next((n for n in LANES[platform] if n >= share), LANES[platform][-1])
        chunks = min(CHUNKS[platform], 1 << (-(-share // each) - 1).bit_length())
        block = each * chunks * devices
        program = self._program(chunks, devices, each)
        parts = []
        for begin in range(0, count, block):
            cut = functools.partial(_cut, begin=begin, end=begin + block)
            inputs = jax.tree.map(cut, (y, readings))
            left = jnp.asarray(stragglers, readings.measured.dtype)
            parts.append(program(left, inputs))
        if len(parts) == 1 and count == block:
            return parts[0]
        return jax.tree.map(lambda *x: jnp.concatenate(x, axis=-1)[..., :count], *parts)

    def _program(
        self, chunks: int, devices: int, each: int
    ) -> Callable[..., LaneResults]:
        """Return the program of one block; compiled once."""
        if (chunks, each) not in self.programs:

            def here(stragglers, inputs: Inputs) -> LaneResults:
                """Fit the chunks of a device one after another."""
                if chunks == 1:
                    return self.loop.fit(stragglers, inputs)
                split = jax.tree.map(
                    lambda x: jnp.moveaxis(x.reshape(*x.shape[:-1], chunks, -1), -2, 0),
                    inputs,
                )
                results = jax.lax.map(lambda x: self.loop.fit(stragglers, x), split)
                return jax.tree.map(
                    lambda x: jnp.moveaxis(x, 0, -2).reshape(*x.shape[1:-1], -1),
                    results,
                )

            spread = here if devices == 1 else _over_devices(here, devices)
            self.programs[chunks, each] = jax.jit(spread)
        return self.programs[chunks, each]


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
            beyond_array=beyond_array(rows.layout, numbers, readings.bad),
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
        """Solve all lanes but stragglers, then these, and finally wait for the last."""
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
        """Solve all lanes; continue by Newton's method those that do not converge."""
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
        """Start again where a result is doubtful; keep the lowest cost of each log."""
        if not tries:
            return best
        lanes = lanes_where(self.doubtful(best, readings.bad, again_z))
        if lanes.size == 0:
            return best
        logs = lanes if logs is None else logs[lanes]
        few, some = gather_lanes(best, lanes), gather_lanes(readings, lanes)
        # a loop over few lanes takes as long as its slowest, so all tries run in one
        now = len(tries) if lanes.size <= RETRY_LOGS else 1
        z = [where.at(which, some.measured, logs) for which in tries[:now]]
        y = with_effects(self.rows, jnp.concatenate(z, axis=1))
        results = self._ended(compiled, y, gather_lanes(readings, np.tile(lanes, now)))
        for one in np.split(np.arange(now * lanes.size), now):
            few = better(few, gather_lanes(results, one))
        few = self._again(compiled, where, few, some, tries[now:], again_z, logs)
        return scatter_lanes(best, few, lanes)

    def _compiled(self, sigma) -> CompiledLoop:
        """Return the loop for these errors, which are constants of its program."""
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


def with_effects(
    rows: LaneRows, z: Float[Array, "free lane"]
) -> Float[Array, "unknown lane"]:
    """Return unknowns from coordinates, with shared effects of zero."""
    return jnp.concatenate([z, jnp.zeros((rows.effects, z.shape[1]), z.dtype)])


def _cut(x: Array, begin: int, end: int) -> Array:
    """Return a block of lanes, padded with bad ones, which are skipped."""
    x = x[..., begin:end]
    short = end - begin - x.shape[-1]
    around = [(0, 0)] * (x.ndim - 1) + [(0, short)]
    # 1 is True for the flag `bad`, and a harmless reading or error
    return jnp.pad(x, around, constant_values=1) if short else x


def _over_devices(
    here: Callable[..., LaneResults], devices: int
) -> Callable[..., LaneResults]:
    """Return a function that distributes lanes over devices."""
    mesh = jax.make_mesh((devices,), ("lane",), axis_types=(AxisType.Auto,))
    along: dict[int, Any] = {
        n: PartitionSpec(*[None] * (n - 1), "lane") for n in (1, 2, 3)
    }
    one = along[1]
    along_lanes = LaneResults(along[2], one, one, along[3], one, one, one, one)

    def everywhere(stragglers, inputs: Inputs) -> LaneResults:
        return jax.shard_map(
            here,
            mesh=mesh,
            in_specs=(PartitionSpec(), jax.tree.map(lambda x: along[x.ndim], inputs)),
            out_specs=along_lanes,
            check_vma=False,
        )(stragglers, inputs)

    return everywhere
