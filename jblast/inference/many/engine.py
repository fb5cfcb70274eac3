"""The compiled program that fits logs of one layout.

One loop fits a block of lanes by Levenberg-Marquardt and evaluates the covariance and
convergence of each result. A batch of any size is cut into blocks, over all devices,
and compiled once for each size of block. A loop does not wait for its slowest lanes:
a share of stragglers is collected, and continued together. Doubtful lanes are tried
again from other starts. Programs are kept for the `KEPT` latest layouts.
"""

import functools
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
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
    faults_of,
    read,
    rows_of,
)
from jblast.inference.many.solver import (
    MAX_UNKNOWNS,
    cholesky,
    expansion,
    inverse_of,
    levenberg_marquardt,
    triangle,
)
from jblast.inference.many.starts import (
    ReferenceSet,
    closed_form,
    given_starts,
    nearest,
    reference_set,
)
from jblast.inference.posterior.parameters import parameters_of
from jblast.inference.posterior.posterior import Posterior
from jblast.scene import UncertainScene
from jblast.sensors import Layout
from jblast.sensors.simulated_readings import Noise
from jblast.waves.height_of_burst import grounded

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
MAX_STEPS = 200
"""Largest number of places that a loop tries."""
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
    sigma: Float[np.ndarray, " row"] | None = None,
) -> "Engine":
    """Return the engine that fits logs of a layout; compiled once for each.

    `sigma` are the instrument errors if all logs have the same.
    """
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
        None if sigma is None else sigma.tobytes(),
    )
    if key not in _ENGINES:
        scene = grounded(uncertain.scene, uncertain.beliefs)
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
        _ENGINES[key] = Engine(rows, sigma, devices)
    return _ENGINES[key]


class Engine:
    """Fits logs of one layout, compiled once for each size of batch.

    Attributes:
        rows: Rows of the layout.
        sigma: Instrument errors if all logs have the same, which makes them constants
            of the program.
        devices: Number of devices.
        form: Closed form of starts, if it applies.
    """

    def __init__(
        self,
        rows: LaneRows,
        sigma: Float[np.ndarray, " row"] | None = None,
        devices: int | None = None,
    ) -> None:
        self.rows, self.sigma = rows, sigma
        self.devices = devices or len(jax.devices())
        self.form = closed_form(rows)
        self.read = jax.jit(functools.partial(read, rows))
        self.program = jax.jit(self._block, static_argnums=0)
        self.doubtful = jax.jit(
            functools.partial(doubtful, rows.noise, len(rows.layout.quantity))
        )
        self.fitted_values = jax.jit(functools.partial(fitted_values, rows))
        self.reference_sets: dict[Any, ReferenceSet] = {}

    def fit(
        self, values, sigma, *, starts, tries: int, seed: int, again_z: float
    ) -> ManyFits:
        """Fit checked logs; see `fit_many`."""
        rows = self.rows
        readings = self.read(values, sigma)
        if starts is not None:
            starts = given_starts(starts, len(values), len(rows.parameters.names))
            tries = min(tries, len(starts))

        in_closed_form = starts is None and self.form is not None

        def start(which: int, measured: Array, lanes: Any) -> Array:
            """Return the starts of one try of some logs."""
            if starts is not None:
                return with_effects(rows, starts[which][:, lanes])
            references = self._reference_set(sigma, seed)
            return with_effects(
                rows, nearest(references, measured, which - in_closed_form)
            )

        # the loop computes the closed form, while the readings are in the cache
        y = None if in_closed_form else start(0, readings.measured, slice(None))
        best = self._solve(y, readings)
        which = 1
        while which < tries:
            lanes = lanes_where(self.doubtful(best, readings.bad, again_z))
            if lanes.size == 0:
                break
            few, some = gather_lanes(best, lanes), gather_lanes(readings, lanes)
            # a loop over few lanes takes as long as its slowest, so all tries run in
            # one
            now = tries - which if lanes.size <= RETRY_LOGS else 1
            y = [start(which + n, some.measured, lanes) for n in range(now)]
            y = jnp.concatenate(y, axis=1)
            results = self._solve(y, gather_lanes(readings, np.tile(lanes, now)))
            for one in np.split(np.arange(now * lanes.size), now):
                few = better(few, gather_lanes(results, one))
            best = scatter_lanes(best, few, lanes)
            which += now
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

    def _solve(
        self, y: Array | None, readings: Readings, times: int = 3
    ) -> LaneResults:
        """Solve all lanes but stragglers, then these, and finally wait for the last."""
        results = self._run(y, readings, STRAGGLERS if times else 0.0)
        lanes = lanes_where(~results.done) if times else np.zeros(0, int)
        if lanes.size == 0:
            return results
        left = gather_lanes(results, lanes)
        again = self._solve(left.y, gather_lanes(readings, lanes), times - 1)
        return scatter_lanes(
            results, again._replace(steps=again.steps + left.steps), lanes
        )

    def _run(
        self, y: Array | None, readings: Readings, stragglers: float
    ) -> LaneResults:
        """Fit lanes block by block; without `y` from the closed form."""
        count = readings.bad.size
        # the smallest size of block that suffices: each size compiles a program
        platform = "cpu" if jax.default_backend() == "cpu" else "gpu"
        share = -(-count // self.devices)
        each = next((n for n in LANES[platform] if n >= share), LANES[platform][-1])
        chunks = min(CHUNKS[platform], 1 << (-(-share // each) - 1).bit_length())
        block = each * chunks * self.devices
        left = jnp.asarray(stragglers, readings.measured.dtype)
        parts = []
        for begin in range(0, count, block):
            cut = functools.partial(_cut, begin=begin, end=begin + block)
            parts.append(self.program(chunks, left, jax.tree.map(cut, (y, readings))))
        if len(parts) == 1 and count == block:
            return parts[0]
        return jax.tree.map(lambda *x: jnp.concatenate(x, axis=-1)[..., :count], *parts)

    def _block(self, chunks: int, stragglers, inputs) -> LaneResults:
        """Fit a block: its lanes are distributed over devices, there in chunks."""

        def here(stragglers, inputs) -> LaneResults:
            """Fit the chunks of a device one after another."""
            if chunks == 1:
                return self._loop(stragglers, *inputs)
            split = jax.tree.map(
                lambda x: jnp.moveaxis(x.reshape(*x.shape[:-1], chunks, -1), -2, 0),
                inputs,
            )
            results = jax.lax.map(lambda x: self._loop(stragglers, *x), split)
            return jax.tree.map(
                lambda x: jnp.moveaxis(x, 0, -2).reshape(*x.shape[1:-1], -1), results
            )

        if self.devices == 1:
            return here(stragglers, inputs)
        mesh = jax.make_mesh((self.devices,), ("lane",), axis_types=(AxisType.Auto,))
        along = jax.tree.map(
            lambda x: PartitionSpec(*[None] * (x.ndim - 1), "lane"), inputs
        )
        out: Any = dict.fromkeys(LaneResults._fields, PartitionSpec("lane")) | {
            "y": PartitionSpec(None, "lane"),
            "covariance": PartitionSpec(None, None, "lane"),
        }
        return jax.shard_map(
            here,
            mesh=mesh,
            in_specs=(PartitionSpec(), along),
            out_specs=LaneResults(**out),
            check_vma=False,
        )(stragglers, inputs)

    def _loop(
        self,
        stragglers: Float[Array, ""],
        y: Float[Array, "unknown lane"] | None,
        readings: Readings,
    ) -> LaneResults:
        """Fit lanes in one loop until all but a share of stragglers have ended."""
        rows, (measured, errors, bad) = self.rows, readings
        if errors is None:  # all logs have the same
            assert self.sigma is not None
            errors = self.sigma[:, None]
        if y is None:
            assert self.form is not None
            y = with_effects(rows, self.form.start(rows, measured))
        bad = bad | ~jnp.isfinite(y).all(axis=0)
        # bad lanes are computed, too, and must not produce NaN in shared reductions
        y = jnp.where(jnp.isfinite(y), y, 0.0)
        # the rounding error of the length of the vector of residuals, as that of a
        # residual is that of the reading's last digit
        scale = jnp.where(errors > 0, errors, 1.0)  # 0: only the law's scatter
        floor = jnp.linalg.norm(measured / scale, axis=0)
        floor = jnp.finfo(measured.dtype).eps * floor

        def expand(y):
            return expansion(rows.loss, y, *rows.miss(y, measured, errors), floor)

        found = levenberg_marquardt(
            expand, y, skip=bad, stragglers=stragglers, max_steps=MAX_STEPS
        )
        here, free = found.here, len(rows.parameters.names)
        misfit, known = here.f, here.hessian
        # the curvature is the information for normal errors of fixed size
        if rows.noise != "gaussian" or rows.varies:
            miss = rows.miss(found.y, measured, errors)
            misfit = jnp.sum(rows.loss(miss.residual)[0][: rows.scored], axis=0)
            if rows.varies:
                miss = rows.miss(found.y, measured, errors, sd_known=True)
            known = triangle(miss.columns, rows.loss.information(miss.residual))
        factor = cholesky(known)
        columns = inverse_of(factor)
        covariance = jnp.stack([jnp.stack(c[:free]) for c in columns[:free]])
        return LaneResults(
            y=found.y,
            cost=here.f,
            misfit=misfit,
            covariance=jnp.where(factor.positive, covariance, jnp.nan),
            converged=here.at_optimum() & ~bad,
            tolerance=jnp.sqrt(here.square_tolerance()),
            steps=found.steps,
            done=found.done,
        )

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
            self.reference_sets[key] = reference_set(
                jax.random.key(seed), blank, self.rows, typical
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
