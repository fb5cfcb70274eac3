r"""The posterior density of a log in the coordinates that no formula integrates out.

One compiled program evaluates the laws at `LANES` places (`seen_at`); everything else
is NumPy (`likelihood`, `coordinates`). A number is linear if its slope in all rows is
the same at eight places and two steps; then it is a column of the likelihood and has no
coordinate. No list of names decides it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.special import logsumexp

from jblast.fidelity.errors import methods_for
from jblast.inference.coordinates import (
    FAR,
    MASS,
    NEAR,
    SPREADS,
    Coordinates,
    Other,
)
from jblast.inference.fitting.solution import choices_for
from jblast.inference.likelihood import (
    ROUNDS,
    Rows,
    Seen,
    chosen,
    exact_gain,
    log_likelihoods,
)
from jblast.inference.posterior.parameters import parameters_of
from jblast.inference.posterior.posterior import Posterior, posterior_of
from jblast.kept_programs import kept
from jblast.observations import Observations
from jblast.parameters import CHARGE_POSITION
from jblast.quantities import ARRIVALS, CIRCULAR, CLOCK_TIMES
from jblast.registry import call, law_for
from jblast.scene import Free, Scene, UncertainScene, parameter_named, with_values
from jblast.scene.uncertain import Normal as NormalPrior, value_of
from jblast.sensors import Layout, layout_of, record
from jblast.sensors.law_choice import law_names
from jblast.sensors.path_scatter import DENSE, KERNELS
from jblast.sensors.record import path_to, to_error_scale
from jblast.sensors.simulated_readings import Noise

LANES = 512
"""Places of one call of the compiled program."""
SOUND = 340.0
"""Speed by which the range of sensors at one place is bounded [m/s]."""
NOWHERE = -1e9
"""ln of a density that is not finite."""
STEP = 1e-4
"""Step of the forward differences of the laws in a coordinate, all of order 1."""
PROBES = 8
"""Places at which the slope of a linear number must be the same."""
SCALES = 16
"""Draws of the scales of own errors for the exact weight of a draw: its ln then varies
by 0.1 to 0.3."""


@kept
def seen_at(
    values: Float[Array, "place name"],
    scene: Scene,
    layout: Layout,
    names: tuple[str, ...],
    laws: tuple[tuple[str, str], ...],
) -> Seen:
    """Return what laws say of the rows at a batch of places."""

    def one(at):
        there = with_values(scene, dict(zip(names, at, strict=True)))
        found = record(there, layout, dict(laws))
        return Seen(
            to_error_scale(found.value, layout.quantity),
            found.record_sd,
            found.shot_loading,
            found.path_loading,
            found.arrival_sd,
            found.place,
            found.placed,
            found.valid,
        )

    return jax.vmap(one)(values)


@kept
def valid_at(
    values: Float[Array, "place name"],
    scene: Scene,
    layout: Layout,
    names: tuple[str, ...],
    laws: tuple[tuple[str, str], ...],
) -> Float[Array, "place law"]:
    """Return the share of its rows for which each law is valid, at each place."""

    def one(at):
        there = with_values(scene, dict(zip(names, at, strict=True)))
        shares = []
        for quantity, name in laws:
            holds = []
            for shot, charge in enumerate(there.charges):
                rows, _ = layout.rows(quantity, shot)
                path = path_to(there, layout, charge.as_if_at_zero())
                path = jax.tree.map(lambda x, r=rows: x[r] if x.ndim else x, path)
                path = replace(path, charge_mass=charge.tnt_mass(quantity))
                valid = call(law_for(quantity, name).valid, path)
                holds.append(jnp.broadcast_to(valid, rows.shape))
            shares.append(jnp.concatenate(holds).mean())
        return jnp.stack(shares)

    return jax.vmap(one)(values)


@dataclass(frozen=True)
class Scored:
    """A batch of places of a climb.

    Attributes:
        log_density: ln of the density, up to a constant.
        slope: Its slope.
        information: Its expected curvature (Gauss-Newton).
    """

    log_density: Float[np.ndarray, " place"]
    slope: Float[np.ndarray, "place free"]
    information: Float[np.ndarray, "place free free"]

    def only(self, which: Any) -> "Scored":
        """Return some places."""
        return Scored(
            self.log_density[which], self.slope[which], self.information[which]
        )

    def where(self, better: np.ndarray, other: "Scored") -> "Scored":
        """Return the places of another batch where it is better."""
        return Scored(
            np.where(better, other.log_density, self.log_density),
            np.where(better[:, None], other.slope, self.slope),
            np.where(better[:, None, None], other.information, self.information),
        )


@dataclass(frozen=True)
class Density:
    """The posterior density of a log by given laws.

    Attributes:
        observations: The log, its positions resolved.
        uncertain: The scene with its unknown numbers.
        scene: The scene with its curve sets settled, and numbers as arrays.
        layout: Rows of the log.
        laws: Name of the law of each quantity.
        posterior: The density as a function that JAX differentiates.
        coordinates: Coordinates and their prior.
        rows: What the likelihood needs beside the laws.
        noise: Distribution of the own errors.
    """

    observations: Observations
    uncertain: UncertainScene
    scene: Scene
    layout: Layout
    laws: Mapping[str, str]
    posterior: Posterior
    coordinates: Coordinates
    rows: Rows
    noise: Noise

    def __call__(
        self, u: Float[np.ndarray, "draw free"], rounds: int = ROUNDS
    ) -> Float[np.ndarray, " draw"]:
        """Return ln of the density: mean over the kernels, and the prior."""
        parts = [
            log_likelihoods(np, self.rows, self.seen(part), rounds)[0]
            for part in _parts(u)
        ]
        return self._total(np.concatenate(parts), self.coordinates.log_prior(u))

    def _total(self, by_kernel, prior) -> Float[np.ndarray, " draw"]:
        total = logsumexp(by_kernel, axis=1) - math.log(by_kernel.shape[1]) + prior
        return np.where(np.isfinite(total), total, NOWHERE)

    def seen(self, u: Float[np.ndarray, "draw free"]) -> Seen:
        """Return what the laws say of the rows at coordinates."""
        return self.seen_with(self.coordinates.values(u))

    def seen_with(self, values: Float[np.ndarray, "draw name"]) -> Seen:
        """Return what the laws say of the rows for given numbers."""
        return self._in_lanes(seen_at, values, tuple(sorted(self.laws.items())))

    def valid_shares(
        self, u: Float[np.ndarray, "draw free"], laws: tuple[tuple[str, str], ...]
    ) -> Float[np.ndarray, "draw law"]:
        """Return the share of its rows for which each law is valid."""
        return self._in_lanes(valid_at, self.coordinates.values(u), laws)

    def _in_lanes(self, program, values, laws):
        found = []
        for part in _parts(values):
            padding = np.repeat(part[-1:], LANES - len(part), 0)
            answer = program(
                jnp.asarray(np.concatenate([part, padding])),
                self.scene,
                self.layout,
                self.coordinates.names,
                laws,
            )
            count = len(part)
            found.append(jax.tree.map(lambda x, n=count: np.asarray(x)[:n], answer))
        return jax.tree.map(lambda *x: np.concatenate(x), *found)

    def scored(self, u: Float[np.ndarray, "draw free"]) -> Scored:
        """Return ln of the density, its slope and information.

        The slopes of the laws are forward differences. The covariance of the errors
        counts as constant. A violated bound counts as a reading, a satisfied one not.
        """
        count, size = u.shape
        steps = STEP * np.eye(size)
        moved = np.concatenate([u, *(u + step for step in steps)])
        seen = self.seen(moved)
        here = jax.tree.map(lambda x: x[:count], seen)
        by_kernel, field = log_likelihoods(np, self.rows, here)
        prior = self.coordinates.log_prior(u)
        total = self._total(by_kernel, prior)
        ends = seen.predicted[count:].reshape(size, count, -1)
        jacobian = np.moveaxis((ends - seen.predicted[:count]) / STEP, 0, 2)
        if len(self.rows.bound):
            satisfied = self.rows.is_bound & (field.residual[:, 0] < 0)
            readings = replace(self.rows, is_bound=np.zeros_like(self.rows.is_bound))
            loose = here._replace(record_sd=here.record_sd + 1e3 * satisfied)
            _, field = log_likelihoods(np, readings, loose)
        else:
            jacobian = jacobian[:, self.rows.read]
        jacobian = np.nan_to_num(jacobian)
        best = np.arange(count), by_kernel.argmax(1)
        of_prior = np.stack(
            [(self.coordinates.log_prior(u + s) - prior) / STEP for s in steps], axis=1
        )
        slope = np.einsum("mnj,mn->mj", jacobian, np.nan_to_num(field.weighted[best]))
        precision = np.nan_to_num(field.precision[best])
        information = np.swapaxes(jacobian, 1, 2) @ precision @ jacobian
        return Scored(
            total,
            slope + of_prior.clip(-20, 20),
            information + self.coordinates.information(),
        )

    def exact(
        self, u: Float[np.ndarray, "draw free"], rng: np.random.Generator
    ) -> tuple[Float[np.ndarray, " draw"], Float[np.ndarray, "draw name"]]:
        """Return ln of the exact over the approximate density, and all numbers.

        The ratio is an unbiased estimate. Linear numbers are drawn given the others.
        """
        gains, numbers = [], []
        for part in _parts(u):
            values = self.coordinates.values(part)
            by_kernel, field = log_likelihoods(np, self.rows, self.seen_with(values))
            total = logsumexp(by_kernel, axis=1)
            kernel = chosen(np.exp(by_kernel - total[:, None]), rng)
            approximate = by_kernel[np.arange(len(part)), kernel]
            gain, linear = exact_gain(
                self.rows, field, kernel, approximate, SCALES, rng
            )
            values[:, list(self.coordinates.linear)] += linear
            gains.append(gain)
            numbers.append(values)
        return np.concatenate(gains), np.concatenate(numbers)

    def of_shot(self, shot: int) -> "Density":
        """Return the density by the rows of one charge alone."""
        out = np.array(self.layout.shot) != shot
        # an error that leaves a row no weight: the rows keep their shape
        sigma = np.where(out, 1e6, self.rows.sigma)
        return replace(self, rows=replace(self.rows, sigma=sigma))

    def scene_at(self, values: Float[np.ndarray, " name"]) -> Scene:
        """Return the scene with given numbers."""
        return with_values(
            self.uncertain.scene, dict(zip(self.coordinates.names, values, strict=True))
        )

    def with_laws(self, near: Scene, laws: Mapping[str, str]) -> "Density":
        """Return the density by other laws, with the curve sets of a scene."""
        named = dict(self.uncertain.scene.law)
        parts = _settled(
            self.observations, self.uncertain, near, {**named, **laws}, self.noise
        )
        rows = replace(
            parts["rows"], columns=self.rows.columns, precision=self.rows.precision
        )
        return replace(self, **{**parts, "rows": rows})

    def chosen_over(self, u: Float[np.ndarray, "draw free"]) -> "Density":
        """Return the density by the laws that are valid for most rows of draws.

        Today's choice stays if its share is within a hundredth.
        """
        named = dict(self.uncertain.scene.law)
        wanted = tuple(
            (quantity, name)
            for quantity in self.layout.quantities()
            if named.get(quantity, "auto") == "auto"
            for name in methods_for(quantity)
        )
        if not wanted:
            return self
        shares = dict(zip(wanted, self.valid_shares(u, wanted).mean(0), strict=True))
        found = {}
        for quantity in dict.fromkeys(quantity for quantity, _ in wanted):
            names = [name for of, name in wanted if of == quantity]
            best = max(names, key=lambda name, of=quantity: shares[of, name])
            now = self.laws[quantity]
            stays = shares.get((quantity, now), 0.0) > shares[quantity, best] - 0.01
            found[quantity] = now if stays else best
        return self.with_laws(self.uncertain.scene, found)

    def laws_at(
        self, u: Float[np.ndarray, "draw free"], weights: Float[np.ndarray, " draw"]
    ) -> dict[str, str]:
        """Return the automatic laws at the most probable draw.

        A law is exchanged only for one that is valid for no less of the draws.
        """
        best = self.coordinates.values(u[[weights.argmax()]])[0]
        there = self.scene_at(best)
        asked = replace(there, law=self.uncertain.scene.law)
        rows = layout_of(self.observations, there)
        choices = choices_for(asked, rows, self.observations.error_scale())
        new = law_names(choices.laws)
        pairs = tuple(
            (quantity, name)
            for quantity in new
            for name in dict.fromkeys((new[quantity], self.laws[quantity]))
        )
        shares = dict(zip(pairs, weights @ self.valid_shares(u, pairs), strict=True))
        return {
            quantity: new[quantity]
            if shares[quantity, new[quantity]]
            > shares[quantity, self.laws[quantity]] - 0.01
            else self.laws[quantity]
            for quantity in new
        }


def density_of(
    observations: Observations, uncertain: UncertainScene, noise: Noise = "student"
) -> Density:
    """Return the density of a log whose positions are resolved."""
    scene = uncertain.scene
    parts = _settled(observations, uncertain, scene, dict(scene.law), noise)
    posterior: Posterior = parts["posterior"]
    names, beliefs = posterior.parameters.names, posterior.parameters.beliefs
    blank = Coordinates(
        names=names,
        beliefs=beliefs,
        base=_base(names, beliefs, parts["layout"], parts["rows"]),
        places=_places(names, beliefs),
        others=(),
        linear=(),
        **_array(parts["layout"], parts["rows"]),
    )
    density = Density(
        observations=observations,
        uncertain=uncertain,
        coordinates=blank,
        noise=noise,
        **parts,
    )
    return _with_linear_numbers(density)


def _settled(
    observations: Observations,
    uncertain: UncertainScene,
    near: Scene,
    laws: Mapping[str, str],
    noise: Noise,
) -> dict[str, Any]:
    """Return scene, layout, laws, posterior and rows for a choice of laws."""
    rows = layout_of(observations, near)
    named = replace(near, law=tuple(laws.items()))
    choices = choices_for(named, rows, observations.error_scale())
    taken = law_names(choices.laws)
    posterior = posterior_of(
        parameters_of(replace(uncertain, scene=choices.scene)),
        choices.layout,
        observations,
        taken,
        noise,
    )
    opened = jax.tree.map(
        lambda x: jnp.asarray(x) if isinstance(x, float) else x,
        (choices.scene, choices.layout),
    )
    scene, layout = opened
    return {
        "scene": scene,
        "layout": layout,
        "laws": taken,
        "posterior": posterior,
        "rows": _rows(posterior, scene, layout),
    }


def _rows(posterior: Posterior, scene: Scene, layout: Layout) -> Rows:
    count = len(layout.quantity)
    group = np.array(layout.group)
    low = np.zeros(count, bool)
    if posterior.lower_bound is not None:
        low = np.asarray(posterior.lower_bound)
    shared = np.zeros((count, 0))
    if posterior.shared_error is not None:
        shared = np.asarray(posterior.shared_error)
    bases = {name.partition(".")[0] for name in posterior.parameters.names}
    # only the range of an array depends on the kernel
    weighted = (
        posterior.neighbours
        and 2 <= len(set(layout.group)) <= DENSE
        and bool(bases & {*CHARGE_POSITION})
    )
    paths = {}
    for quantity, (shot, charge) in product(
        layout.quantities(), enumerate(scene.charges)
    ):
        of_shot, _ = layout.rows(quantity, shot)
        _, first, of = np.unique(group[of_shot], return_index=True, return_inverse=True)
        of_row = np.zeros(count, int)
        of_row[of_shot] = of
        paths[quantity + scene.label(charge)] = of_shot[first], of_row
    return Rows(
        measured=np.asarray(posterior.measured),
        sigma=np.asarray(posterior.sigma),
        circular=np.isin(layout.quantity, CIRCULAR),
        is_bound=low,
        same_path=group[:, None] == group,
        shared=shared @ shared.T,
        columns=np.zeros((count, 0)),
        precision=np.zeros(0),
        kernels=KERNELS if weighted else KERNELS[2:3],
        paths=paths,
        noise=posterior.noise,
    )


def _places(names, beliefs) -> tuple[tuple[int, int], ...]:
    """Return the indices of east and north of each charge with a free place."""
    free = {
        name: i
        for i, (name, belief) in enumerate(zip(names, beliefs, strict=True))
        if isinstance(belief, Free)
    }
    east, north, _ = CHARGE_POSITION
    labels = [n.removeprefix(east) for n in free if n.startswith(east)]
    return tuple(
        (free[east + label], free[north + label])
        for label in labels
        if north + label in free
    )


def _array(layout: Layout, rows: Rows) -> dict[str, Any]:
    """Return middle, size and bounds of the sensors."""
    at = np.asarray(layout.places())
    at = at if len(at) else np.zeros((1, 3))
    level = at[:, :2]
    width = float(np.linalg.norm(level[:, None] - level[None], axis=-1).max())
    clock, quantity = np.array(layout.clock), np.array(layout.quantity)
    timed = np.asarray(layout.time)
    timed = np.where(np.isin(quantity, CLOCK_TIMES), rows.measured, timed)
    heard = 0.0
    for name in set(clock):
        of_clock = (clock == name) & np.isfinite(timed)
        bangs = np.isin(quantity, ARRIVALS) & of_clock
        if bangs.any():
            took = timed[bangs].max() - timed[of_clock].min()
            heard = max(heard, SOUND * float(took))
    radius = NEAR * (width or heard) or 1.0
    far = max(FAR * width, 10 * heard) or 1e5
    given = np.asarray(layout.time)
    finite = given[np.isfinite(given)]
    return {
        "middle": level.mean(0),
        "up": float(at[:, 2].mean()),
        "radius": radius,
        "most": math.asinh(far / radius),
        "first": float(finite.min()) if finite.size else math.nan,
    }


def _base(names, beliefs, layout: Layout, rows: Rows) -> Float[np.ndarray, " name"]:
    """Return the values at which numbers are held where they are linear."""
    clocks = np.isin(layout.quantity, CLOCK_TIMES)
    begin = float(rows.measured[clocks].min()) if clocks.any() else 0.0
    return np.array(
        [
            float(belief.constrain(0.0))
            if not isinstance(belief, Free)
            else begin * name.startswith("origin_time_s")
            for name, belief in zip(names, beliefs, strict=True)
        ]
    )


def _with_linear_numbers(density: Density) -> Density:
    """Return the density with its linear numbers as columns, and the others' axes."""
    blank = density.coordinates
    placed = [i for pair in blank.places for i in pair]
    left = [i for i in range(len(blank.names)) if i not in placed]
    rng = np.random.default_rng(0)
    probe = np.tile(blank.base, (PROBES, 1))
    for i in left:
        belief = blank.beliefs[i]
        if isinstance(belief, Free) and belief.positive:
            start = float(np.asarray(belief.constrain(_start(density, i))))
            probe[:, i] = start * np.exp(rng.normal(0, 1, PROBES))
    for pair in blank.places:
        away = rng.normal(0, blank.radius / NEAR, (PROBES, 2))
        probe[:, pair] = blank.middle + away
    here = density.seen_with(probe).predicted
    linear, columns, precision, others = [], [], [], []
    for i in left:
        belief = blank.beliefs[i]
        unit = np.arange(len(blank.names)) == i
        slopes = np.concatenate(
            [
                (here - density.seen_with(probe - h * unit).predicted) / h
                for h in (0.01, 2)
            ]
        )
        if _is_linear(belief, slopes):
            linear.append(i)
            columns.append(slopes.mean(0).round(9))
            sd = math.inf
            if not isinstance(belief, Free):
                sd = float(belief.constrain(1.0) - belief.constrain(0.0))
            precision.append(sd**-2)
        else:
            others.append(_axis(density, i))
    rows = replace(
        density.rows,
        columns=np.stack(columns, 1) if columns else density.rows.columns,
        precision=np.array(precision),
    )
    coordinates = replace(blank, linear=tuple(linear), others=tuple(others))
    return replace(density, coordinates=coordinates, rows=rows)


def _is_linear(belief, slopes: Float[np.ndarray, "probe row"]) -> bool:
    affine = isinstance(belief, NormalPrior) or (
        isinstance(belief, Free) and not belief.positive
    )
    return bool(
        affine
        and np.isfinite(slopes).all()
        and np.allclose(slopes, slopes[0], atol=1e-6)
        and np.abs(slopes).max() > 0
    )


def _start(density: Density, i: int) -> float:
    """Return the fitted coordinate of a number of the scene."""
    name, belief = density.coordinates.names[i], density.coordinates.beliefs[i]
    return float(belief.unconstrain(np.asarray(value_of(density.scene, name))))


def _axis(density: Density, i: int) -> Other:
    """Return the coordinate of a number that is not linear."""
    name, belief = density.coordinates.names[i], density.coordinates.beliefs[i]
    if not isinstance(belief, Free):
        return Other(i, "score", -3.5, 3.5)
    if name.startswith("charge_mass_kg"):
        return Other(i, "flat", *MASS)
    if name.startswith("origin_time_s"):
        return Other(i, "time", math.log(1e-6), math.log(1e3))
    if name.startswith("charge_up_m"):
        return Other(i, "height", -1.5, 1.5)
    amount = parameter_named(name).spread.amount
    half = SPREADS * (math.log(amount) if belief.positive else amount)
    middle = _start(density, i)
    return Other(i, "flat", middle - half, middle + half)


def _parts(u: np.ndarray) -> Sequence[np.ndarray]:
    return [u[first : first + LANES] for first in range(0, len(u), LANES)]
