"""The same fit for thousands to millions of independent logs of one layout."""

import functools
from collections.abc import Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jax.sharding import AxisType, PartitionSpec
from jaxtyping import Array, Bool, Float, Int

from jblast.errors import InputError
from jblast.inference.many.closed_form import closed_form
from jblast.inference.many.normal_equations import (
    MOST_UNKNOWNS,
    cholesky,
    inverse_of,
)
from jblast.inference.many.rows import Rows, rows_of
from jblast.inference.many.solver import (
    LaneLevenbergMarquardt,
    half_square,
    triangle,
)
from jblast.inference.many.starts import Library, library
from jblast.inference.parameters import Parameters, parameters_of
from jblast.inference.posterior import Posterior
from jblast.observations import TIMES
from jblast.scene import UncertainScene
from jblast.sensors import Layout
from jblast.sensors.observe import Noise

LANES = {"cpu": (16, 128), "gpu": (1 << 10, 1 << 14, 1 << 18, 1 << 20)}
"""Logs that go through one loop together, by platform: the least that suffices."""
CHUNKS = {"cpu": 128, "gpu": 1}
"""Loops that one call of the compiled program runs, on each device."""
STRAGGLERS = 0.02
"""A loop does not wait for this share of its logs; they go on together later."""
MOST_STEPS = 200
COST = {"gaussian": (0.5, 0.70711), "student": (0.70093, 0.98290)}
"""Mean and standard deviation of the cost of one reading: for Student-t of nu degrees
of freedom, with a = (nu + 1)/2, a (psi(a) - psi(nu/2)) and a sqrt(psi'(nu/2) -
psi'(a)), since 1/(1 + t^2/nu) is a beta variable."""
HARDLY = 6.0
"""A cost that is this many standard deviations above its mean makes an end doubtful."""
NAMED = 20
"""So many bad logs are named."""
FEW_STEPS, MANY_STEPS = 12, 200
"""Logs not at their optimum after a few steps are put together and go on."""


class ManyFits(eqx.Module):
    """What many logs say, each of its own blast.

    Attributes:
        names: The free numbers.
        z: Where the optimum is, in fitted coordinates (ln of positive numbers); NaN
            for a bad log.
        values: The numbers by name.
        cost: Minus ln of the joint density at the optimum, up to a constant.
        misfit: What of it the readings and priors add, 0 for a perfect log.
        covariance: Of the coordinates, by Fisher information; NaN where that is
            singular.
        converged: Whether $z$ is an optimum: the gradient, in standard deviations, is
            down to `tolerance`, and the cost curves upwards on every side. It does not
            say that it is the best one.
        tolerance: How long a gradient counts as none; larger where rounding hides more.
        steps: Places tried.
        bad: Whether a log could not be read.
        faults: What is wrong with each of the first bad logs, by number.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    z: Float[Array, "log free"]
    values: dict[str, Float[Array, " log"]]
    cost: Float[Array, " log"]
    misfit: Float[Array, " log"]
    covariance: Float[Array, "log free free"]
    converged: Bool[Array, " log"]
    tolerance: Float[Array, " log"]
    steps: Int[Array, " log"]
    bad: Bool[Array, " log"]
    faults: tuple[tuple[int, str], ...] = eqx.field(static=True)

    def sd(self) -> Float[Array, "log free"]:
        """Return the standard deviation of each coordinate."""
        return jnp.sqrt(jnp.diagonal(self.covariance, axis1=1, axis2=2))


def fit_many(
    uncertain: UncertainScene,
    layout: Layout,
    values: Float[Array, "log row"] | Float[np.ndarray, "log row"],
    sigma: Float[Array, "..."] | Float[np.ndarray, "..."],
    laws: Mapping[str, str],
    *,
    noise: Noise = "student",
    starts: Float[Array, "..."] | Float[np.ndarray, "..."] | None = None,
    tries: int = 4,
    seed: int = 0,
) -> ManyFits:
    r"""Fit many logs of one layout.

    What is minimised for each log is minus ln of the joint density of its readings, the
    shared effects among the unknowns (`fit` integrates them out: where laws scatter,
    its optimum differs by what ln det of their curvature varies). Levenberg-Marquardt
    (`LaneLevenbergMarquardt`), on all devices there are.

    Args:
        uncertain: The scene and what is not known of it, the same for all logs.
        layout: Who recorded what.
        values: The readings.
        sigma: Their instrument errors, of each row or of each row of each log: seconds
            for times, relative otherwise.
        laws: Name of the law for each of `layout.quantities()`.
        noise: Distribution of the independent errors.
        starts: Fitted coordinates to start from, (log, free) or (try, log, free);
            without them in closed form (`many.closed_form`), or where that does not
            apply, and for tries after the first, the nearest of a library of random
            places, by the readings (`many.starts`).
        tries: How often a log may start again whose end is no optimum, or has a cost
            that readings would hardly have (`HARDLY`); its lowest end counts.
        seed: Of the library.

    Raises:
        InputError: The batch as a whole cannot be fitted. A bad log does not raise: its
            lane alone fails, and `faults` says why.
    """
    engine = engine_for(uncertain, layout, laws, noise)
    return engine.fit(values, sigma, starts=starts, tries=tries, seed=seed)


_ENGINES: dict[Any, "Engine"] = {}
KEPT = 16
"""Layouts whose compiled programs are kept."""


def engine_for(
    uncertain: UncertainScene, layout: Layout, laws: Mapping[str, str], noise: Noise
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
    )
    if key not in _ENGINES:
        parameters = parameters_of(uncertain)
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
        _ENGINES[key] = Engine(parameters, rows)
    return _ENGINES[key]


class _Ends(NamedTuple):
    """Where lanes ended; see `ManyFits`. The lane is the last axis."""

    y: Float[Array, "unknown lane"]
    cost: Float[Array, " lane"]
    misfit: Float[Array, " lane"]
    covariance: Float[Array, "free free lane"]
    converged: Bool[Array, " lane"]
    tolerance: Float[Array, " lane"]
    steps: Int[Array, " lane"]
    done: Bool[Array, " lane"]


class Engine:
    """Fits logs of one layout, compiled once for each size of batch."""

    def __init__(self, parameters: Parameters, rows: Rows) -> None:
        self.parameters = parameters
        self.rows = rows
        plain = rows.noise == "gaussian" and not rows.varies
        loss = half_square if plain else rows.loss
        self.solver = LaneLevenbergMarquardt(loss=loss, jacobian="aux")
        self.closed_form = closed_form(rows)
        self.programs: dict[Any, Any] = {}
        self.libraries: dict[Any, Library] = {}

    def fit(self, values, sigma, *, starts, tries: int, seed: int) -> ManyFits:
        """Fit logs; see `fit_many`."""
        layout, free = self.rows.layout, len(self.parameters.names)
        shape = np.shape(values)
        if len(shape) != 2 or shape[1] != len(layout.quantity):
            raise InputError(
                f"values: expected (log, row) with {len(layout.quantity)} rows, "
                f"got {shape}"
            )
        if np.shape(sigma) not in (shape, shape[1:]):
            raise InputError(
                f"sigma: expected {shape[1:]} or {shape}, got {np.shape(sigma)}"
            )
        values = jnp.asarray(values)
        if np.ndim(sigma) == 1:
            # known beforehand, so that the program holds them as constants
            sigma = np.asarray(sigma, values.dtype)
            if not (np.isfinite(sigma) & (sigma >= 0)).all():
                raise InputError(f"sigma: expected finite errors, got {sigma}")
        else:
            sigma = jnp.asarray(sigma)
        measured, errors, bad = self._program("read", None, self._read)(values, sigma)
        fixed = sigma[:, None] if isinstance(sigma, np.ndarray) else None
        given = starts is not None
        places = None
        if not given and self.closed_form is None:
            places = self._library(sigma, seed)
        if given:
            starts = jnp.asarray(starts)
            if starts.shape[-2:] != (shape[0], free) or starts.ndim not in (2, 3):
                raise InputError(
                    f"starts: expected ({shape[0]}, {free}), or as many for each try, "
                    f"got {starts.shape}"
                )
            places = jnp.moveaxis(starts.reshape(-1, shape[0], free), 2, 1)
            tries = min(tries, len(places))
        best = self._solve(places, 0, measured, errors, bad, fixed)
        for again in range(1, tries):
            left = _padded(self._program("doubtful", None, self._doubtful)(best, bad))
            if left.size == 0:
                break
            where = places if given else self._library(sigma, seed)
            some = self._program("pick", None, _picked)
            where = some(where, left) if given else where
            ends = self._solve(
                where, again, *some((measured, errors, bad), left), fixed
            )
            ends = self._program("better", None, _better)(some(best, left), ends)
            best = self._program("put", None, _put)(best, ends, left)
        z, covariance, numbers, cost, misfit = self._program("told", None, self._told)(
            best, bad
        )
        return ManyFits(
            names=self.parameters.names,
            z=z,
            values=numbers,
            cost=cost,
            misfit=misfit,
            covariance=covariance,
            converged=best.converged,
            tolerance=best.tolerance,
            steps=best.steps,
            bad=bad,
            faults=self._faults(values, sigma, np.flatnonzero(bad)),
        )

    def straight(self, values) -> Float[Array, "log free"]:
        """Return the starts in closed form."""
        return self._closed(self.rows.comparable(jnp.asarray(values))).T

    def _program(self, name: str, known: Any, function):
        """Compile once."""
        key = name, None if known is None else known.tobytes()
        if key not in self.programs:
            self.programs[key] = jax.jit(function)
        return self.programs[key]

    def _read(self, values, sigma):
        """Turn readings into what is fitted, and find the logs that cannot be."""
        timed = np.isin(self.rows.layout.quantity, TIMES)[None, :]
        good = jnp.isfinite(values) & (timed | (values > 0))
        sigmas = jnp.broadcast_to(jnp.atleast_2d(jnp.asarray(sigma)), values.shape)
        good = good & jnp.isfinite(sigmas) & (sigmas >= 0)
        bad = ~good.all(axis=1)
        measured = self.rows.comparable(jnp.where(good, values, 1.0))
        errors = jnp.where(bad[:, None], 1.0, sigmas).T
        return measured, errors[:, :1] if np.ndim(sigma) == 1 else errors, bad

    def _told(self, ends: _Ends, bad):
        """Put the ends as the answer has them."""
        z = ends.y[: len(self.parameters.names)]
        z = jnp.where(bad[None, :], jnp.nan, z)
        numbers = {
            name: belief.constrain(z[k])
            for k, (name, belief) in enumerate(
                zip(self.parameters.names, self.parameters.beliefs, strict=True)
            )
        }
        covariance = jnp.where(bad[None, None, :], jnp.nan, ends.covariance)
        costs = (jnp.where(bad, jnp.nan, c) for c in (ends.cost, ends.misfit))
        return z.T, jnp.moveaxis(covariance, 2, 0), numbers, *costs

    def _faults(self, values, sigma, bad) -> tuple[tuple[int, str], ...]:
        """Say what is wrong with the first bad logs."""
        faults = []
        for log in bad[:NAMED]:
            value, layout = np.asarray(values[log]), self.rows.layout
            error = np.asarray(sigma if np.ndim(sigma) == 1 else sigma[log])
            for row, quantity in enumerate(layout.quantity):
                timed = quantity in TIMES
                if not np.isfinite(value[row]) or not (timed or value[row] > 0):
                    wanted = "a finite time" if timed else "a positive number"
                    got = f"{value[row]}"
                elif not (np.isfinite(error[row]) and error[row] >= 0):
                    wanted, got = "a finite sigma", f"{error[row]}"
                else:
                    continue
                faults.append(
                    (
                        int(log),
                        f"log {log}, row {row}, {quantity}: expected {wanted}, "
                        f"got {got}",
                    )
                )
                break
        return tuple(faults)

    def _library(self, sigma, seed: int) -> Library:
        """Return the library, drawn once."""
        typical = np.asarray(sigma)
        if typical.ndim == 2:
            typical = np.nanmedian(np.where(typical >= 0, typical, np.nan), axis=0)
        key = seed, typical.tobytes()
        if key not in self.libraries:
            layout = self.rows.layout
            blank = Posterior(
                self.parameters,
                layout,
                jnp.zeros(len(layout.quantity)),
                jnp.asarray(typical),
                self.rows.laws,
                self.rows.noise,
            )
            key_of_draws = jax.random.key(seed)
            self.libraries[key] = library(key_of_draws, blank, self.rows, typical)
        return self.libraries[key]

    def _start(self, places, which: int, measured):
        """Return where lanes start."""
        if places is None:
            return self._program("closed form", None, self._closed)(measured)
        if not isinstance(places, Library):
            return places[which]
        which -= self.closed_form is not None

        def nearest(measured, places):
            return places.nearest(measured, which)

        return self._program(f"nearest {which}", None, nearest)(measured, places)

    def _closed(self, measured):
        assert self.closed_form is not None
        return self.closed_form.start(self.rows, measured)

    def _doubtful(self, ends: _Ends, bad):
        """Return which ends may not be the best there are."""
        mean, sd = COST[self.rows.noise]
        n = len(self.rows.layout.quantity)
        likely = ends.misfit <= n * mean + HARDLY * sd * np.sqrt(n)
        return ~(bad | (ends.converged & likely))

    def _solve(self, places, which: int, measured, errors, bad, fixed) -> _Ends:
        """Solve all lanes but for stragglers, then these, and wait for the last."""
        y = self._start(places, which, measured)
        effects = jnp.zeros((self.rows.effects, y.shape[1]), y.dtype)
        y = jnp.concatenate([y, effects])
        ends = self._run(y, measured, errors, bad, fixed, STRAGGLERS)
        some, put = (
            self._program("pick", None, _picked),
            self._program("put", None, _put),
        )
        for waits in (False, False, True):
            left = _padded(~ends.done)
            if left.size == 0:
                break
            share = 0.0 if waits else STRAGGLERS
            y, *rest = some((ends.y, measured, errors, bad), left)
            again = self._run(y, *rest, fixed, share)
            again = again._replace(steps=again.steps + some(ends.steps, left))
            ends = put(ends, again, left)
        return ends

    def _run(self, y, measured, errors, bad, fixed, stragglers: float) -> _Ends:
        """Run lanes through the compiled program, block by block."""
        devices = jax.devices()
        platform = "cpu" if devices[0].platform == "cpu" else "gpu"
        count = measured.shape[1]
        share = -(-count // len(devices))
        each = next((n for n in LANES[platform] if n >= share), LANES[platform][-1])
        chunks = min(CHUNKS[platform], 1 << (-(-share // each) - 1).bit_length())
        block = each * chunks * len(devices)
        program = self._program(
            f"run {chunks} {each}",
            fixed,
            functools.partial(self._block, fixed, chunks, len(devices)),
        )
        parts = []
        for begin in range(0, count, block):
            lanes = slice(begin, begin + block)
            inputs = [y[:, lanes], measured[:, lanes], bad[lanes]]
            if fixed is None:
                inputs.append(errors[:, lanes])
            short = block - inputs[0].shape[1]
            if short:  # lanes that are skipped
                inputs = [
                    jnp.pad(
                        x, [(0, 0)] * (x.ndim - 1) + [(0, short)], constant_values=1
                    )
                    for x in inputs
                ]
            parts.append(program(jnp.asarray(stragglers, y.dtype), *inputs))
        if len(parts) == 1 and count == block:
            return parts[0]
        return jax.tree.map(lambda *x: jnp.concatenate(x, axis=-1)[..., :count], *parts)

    def _block(self, fixed, chunks, devices, stragglers, *inputs) -> _Ends:
        """Spread chunks over devices, and go through them one by one on each."""

        def here(stragglers, *inputs):
            split = [
                jnp.moveaxis(x.reshape(*x.shape[:-1], chunks, -1), -2, 0)
                for x in inputs
            ]
            if chunks == 1:
                return self._chunk(fixed, stragglers, *inputs)
            ends = jax.lax.map(lambda x: self._chunk(fixed, stragglers, *x), split)
            return jax.tree.map(
                lambda x: jnp.moveaxis(x, 0, -2).reshape(*x.shape[1:-1], -1), ends
            )

        if devices == 1:
            return here(stragglers, *inputs)
        mesh = jax.make_mesh((devices,), ("lane",), axis_types=(AxisType.Auto,))
        along: dict[int, Any] = {
            n: PartitionSpec(*[None] * (n - 1), "lane") for n in (1, 2, 3)
        }
        one = along[1]
        of_ends = _Ends(along[2], one, one, along[3], one, one, one, one)
        return jax.shard_map(
            here,
            mesh=mesh,
            in_specs=(PartitionSpec(), *(along[x.ndim] for x in inputs)),
            out_specs=of_ends,
            check_vma=False,
        )(stragglers, *inputs)

    def _chunk(self, fixed, stragglers, y, measured, bad, errors=None) -> _Ends:
        """Fit some lanes, and look at where they ended."""
        rows, free = self.rows, len(self.parameters.names)
        sigma = fixed if errors is None else errors
        bad = bad | ~jnp.isfinite(y).all(axis=0)
        y = jnp.where(jnp.isfinite(y), y, 0.0)
        eps = jnp.finfo(y.dtype).eps
        # a reading minus a prediction is as wrong as the reading's last digit
        size = jnp.sqrt(jnp.sum(jnp.square(measured / _scale(sigma)), axis=0))
        options = {"floor": eps * size, "skip": bad, "stragglers": stragglers}

        def residuals(y, args):
            return rows.miss(y, args[0], sigma if errors is None else args[1])

        found = optx.least_squares(
            residuals,
            self.solver,
            y,
            (measured, errors),
            options=options,
            has_aux=True,
            max_steps=MOST_STEPS,
            throw=False,
        )
        y = found.value
        # what the solver knows of the end is all there is to know, but where errors
        # are not normal, or their size varies
        true, known = found.state.info, found.state.info.hessian
        misfit = true.f
        if rows.varies or rows.noise != "gaussian":
            miss = rows.miss(y, measured, sigma)
            judge = LaneLevenbergMarquardt(loss=rows.true_loss)
            true = judge.normal(y, *miss, options)
            misfit = jnp.sum(rows.loss(miss.residual)[0][: rows.scored], axis=0)
            told = rows.miss(y, measured, sigma, told=True) if rows.varies else miss
            known = triangle(told.columns, rows.information(told.residual))
        factor = cholesky(known)
        columns = inverse_of(factor)
        covariance = jnp.stack([jnp.stack(c[:free]) for c in columns[:free]])
        return _Ends(
            y=y,
            cost=true.f,
            misfit=misfit,
            covariance=jnp.where(factor.positive, covariance, jnp.nan),
            converged=self.solver.at_optimum(true) & ~bad,
            tolerance=jnp.sqrt(self.solver.square_tolerance(true)),
            steps=found.state.steps,
            done=found.state.done | bad,
        )


def _padded(wanted: Bool[Array, " lane"]) -> np.ndarray:
    """Return which lanes; the last again, so that few sizes are ever compiled."""
    left = np.flatnonzero(np.asarray(wanted))
    if left.size == 0:
        return left
    size = max(LANES["cpu"][0], 1 << (left.size - 1).bit_length())
    return np.pad(left, (0, size - left.size), mode="edge")


def _picked(tree, left):
    """Pick lanes; what has one for all of them is left as it is."""
    return jax.tree.map(lambda x: x[..., left] if x.shape[-1] > 1 else x, tree)


def _put(onto: _Ends, new: _Ends, left) -> _Ends:
    """Put lanes in their places."""
    return jax.tree.map(lambda a, b: a.at[..., left].set(b), onto, new)


def _scale(sigma):
    """Return sigma, but 1 where the law's scatter is all there is."""
    return jnp.where(sigma > 0, sigma, 1.0)


def _better(a: _Ends, b: _Ends) -> _Ends:
    """Take the lower end of each lane."""
    lower = ~(a.cost <= b.cost) & jnp.isfinite(b.cost)
    return jax.tree.map(lambda x, y: jnp.where(lower, y, x), a, b)
