r"""The posterior density of a log in the coordinates that no formula integrates out.

One compiled program evaluates the laws at a batch of places (`seen_at`); everything
else is NumPy (`likelihood`, `coordinates`). A number is linear if its slope in all rows
is the same at eight places and two steps; then it is a column of the likelihood and has
no coordinate. No list of names decides it.

The program takes more numbers than are fitted: place, time, clocks and wind as well, so
that questions of the kind "and if this were free" need no other program.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.inference.coordinates import (
    FAR,
    MASS,
    NEAR,
    SPREADS,
    Coordinates,
    Other,
)
from jblast.inference.likelihood import (
    ROUNDS,
    Paths,
    Rows,
    Seen,
    chosen,
    exact_gain,
    log_likelihoods,
    log_sum,
)
from jblast.inference.posterior.parameters import Parameters, parameters_of
from jblast.inference.posterior.posterior import (
    own_and_shared_errors,
    refuse_exact,
    refuse_vast,
)
from jblast.kept_programs import kept
from jblast.observations import Observations
from jblast.observations.clocks import refuse_unresolved
from jblast.observations.table import some_rows
from jblast.parameters import CHARGE_POSITION, CLOCK_OFFSET
from jblast.quantities import ARRIVALS, CIRCULAR, CLOCK_TIMES
from jblast.registry import call, law_for, names_for
from jblast.scene import Free, Scene, UncertainScene, parameter_named, with_values
from jblast.scene.uncertain import Normal as NormalPrior, names_in, value_of
from jblast.sensors import Layout, layout_of, record
from jblast.sensors.forward_model import effects_of, path_to, to_error_scale
from jblast.sensors.law_choice import law_names, resolve_laws
from jblast.sensors.path_scatter import DENSE, KERNELS, MAX_PATHS
from jblast.sensors.simulated_readings import Noise, paths_of
from jblast.waves.choice import TakenLaw, is_candidate
from jblast.waves.height_of_burst import grounded

LANES, ROWS_OF_ALL = 512, 2**18
"""Places of one call of the compiled program, and rows of all of them together."""
NUMBERS = 2**22
"""Numbers in the matrices of the likelihood that are computed together."""
NOWHERE = -1e9
"""ln of a density that is not finite."""
STEP = 1e-4
"""Step of the forward differences of the laws in a coordinate, all of order 1."""
LOST = 1e3
"""Standard deviation of times that the log does not determine one by one, in travel
times of sound over the layout."""
PROBES = 8
"""Places at which the slope of a linear number must be the same."""
SCALES, SCALES_OF_MANY = 16, 4
"""Draws of the scales of own errors for the exact weight of a draw, of few rows and of
many: with 12 rows and 16 draws its ln varies by 0.1 to 0.3."""
FEW_ROWS = 30
"""Rows of a block up to which the mean field takes `likelihood.ROUNDS` rounds; of more
it takes one: the cost grows with their cube, and the weights are exact for any number.
Logs of more rows have half the draws, with fewer scales."""
LEFT_OUT_SIGMA = 1e6
"""Error of a row that is left out: seconds, radians or ln. Its information is 1e-12 of
that of a reading to a second, and the square does not overflow."""
WIND = ("wind_east_m_s", "wind_north_m_s")
"""Numbers that an answer is tested for, besides place, time and clocks."""


@kept
def seen_at(
    values: Float[Array, "place name"],
    scene: Scene,
    layout: Layout,
    names: tuple[str, ...],
    laws: tuple[tuple[str, str], ...],
) -> Seen:
    """Return the predictions of the rows at a batch of places."""
    return jax.vmap(
        lambda at: _seen(scene, layout, dict(laws), dict(zip(names, at, strict=True)))
    )(values)


def _seen(
    scene: Scene, layout: Layout, laws: Mapping[str, str], values: Mapping[str, Any]
) -> Seen:
    """Return the predictions of the rows at one place."""
    found = record(with_values(scene, values), layout, dict(laws))
    return Seen(
        to_error_scale(found.value, layout.quantity),
        found.record_sd,
        found.shot_loading,
        found.path_loading,
        found.arrival_sd,
        found.place,
        found.placed,
        found.valid,
        found.slant_range,
    )


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

    def replaced(self, which: np.ndarray, others: "Scored") -> "Scored":
        """Return it with other places instead of some."""
        parts = (self.log_density, self.slope, self.information)
        news = (others.log_density, others.slope, others.information)
        copies = [part.copy() for part in parts]
        for copy, new in zip(copies, news, strict=True):
            copy[which] = new
        return Scored(*copies)


@dataclass(frozen=True)
class Density:
    """The posterior density of a log by given laws.

    Attributes:
        observations: The log, its positions resolved.
        uncertain: The scene with its unknown numbers.
        scene: The scene with its numbers as arrays.
        layout: Rows of the log.
        laws: Name of the law of each quantity.
        names: Names of the numbers that the program takes.
        held: Values of those that are not fitted.
        coordinates: Coordinates and their prior.
        rows: What the likelihood needs beside the laws.
        is_round: True if no row depends on the bearing of the only free place.
    """

    observations: Observations
    uncertain: UncertainScene
    scene: Scene
    layout: Layout
    laws: Mapping[str, str]
    names: tuple[str, ...]
    held: Mapping[str, float]
    coordinates: Coordinates
    rows: Rows
    is_round: bool = False

    @property
    def noise(self) -> Noise:
        """Distribution of the own errors."""
        return self.rows.noise

    @cached_property
    def parameters(self) -> Parameters:
        """The fitted numbers, with the scene of the curve sets."""
        return parameters_of(replace(self.uncertain, scene=self.scene))

    def log_density(self, z: Float[Array, " name"]) -> Float[Array, ""]:
        """Return ln of the density per unit of all fitted coordinates.

        It is known up to a constant. Linear numbers are not integrated out here. JAX
        can differentiate, compile and vectorise the function.
        """
        axes, rows = self.coordinates, self.rows.of_all_numbers
        pairs = zip(axes.beliefs, axes.names, strict=True)
        values = {name: b.constrain(z[i]) for i, (b, name) in enumerate(pairs)}
        seen = _seen(self.scene, self.layout, self.laws, values)
        one = jax.tree.map(lambda x: jnp.asarray(x)[None], seen)
        by_kernel, _ = log_likelihoods(jnp, rows, one)
        prior = axes.log_prior_of(jnp, jnp.stack(list(values.values())))
        found = jax.scipy.special.logsumexp(by_kernel[0])
        return found - math.log(len(rows.kernels)) + prior

    @property
    def heard(self) -> float:
        """Distance of sound between the first and last time of a clock [m]."""
        return _heard(self.layout, self.rows)

    @property
    def has_few_rows(self) -> bool:
        """True if the exact weight of each draw is taken without smoothing."""
        return len(self.rows.measured) <= FEW_ROWS

    @property
    def rounds(self) -> int:
        """Rounds of the mean field."""
        return ROUNDS if self.rows.block.shape[1] <= FEW_ROWS else 1

    @property
    def lanes(self) -> int:
        """Places of one call of the program."""
        most = max(ROWS_OF_ALL // max(len(self.rows.measured), 1), 1)
        return min(LANES, 2 ** int(math.log2(most)))

    def parts(self, places: int, work: int = 1) -> Sequence[np.ndarray]:
        """Return indices of places in batches whose numbers fit into memory.

        Args:
            places: Number of places.
            work: Number of likelihoods of each.
        """
        size = min(max(NUMBERS // max(self.rows.work * work, 1), 1), self.lanes)
        return np.split(np.arange(places), range(size, places, size))

    def __call__(
        self, u: Float[np.ndarray, "draw free"], rounds: int | None = None
    ) -> Float[np.ndarray, " draw"]:
        """Return ln of the density: mean over the kernels, and the prior."""
        rounds = self.rounds if rounds is None else rounds
        parts = [
            log_likelihoods(np, self.rows, self.seen(u[part]), rounds)[0]
            for part in self.parts(len(u))
        ]
        return self._total(np.concatenate(parts), self.coordinates.log_prior(u))

    def _total(self, by_kernel, prior) -> Float[np.ndarray, " draw"]:
        total = log_sum(by_kernel, axis=1) - math.log(by_kernel.shape[1]) + prior
        return np.where(np.isfinite(total), total, NOWHERE)

    def seen(self, u: Float[np.ndarray, "draw free"]) -> Seen:
        """Return the predictions of the rows at coordinates."""
        return self.seen_with(self.coordinates.values(u))

    def seen_with(
        self, values: Float[np.ndarray, "draw name"], **held: np.ndarray
    ) -> Seen:
        """Return the predictions of the rows for given numbers.

        Args:
            values: The fitted numbers.
            held: Values of other numbers of the program, one each draw.
        """
        return self._in_lanes(seen_at, self._all(values, held), self._laws)

    def valid_shares(
        self, u: Float[np.ndarray, "draw free"], laws: tuple[tuple[str, str], ...]
    ) -> Float[np.ndarray, "draw law"]:
        """Return the share of its rows for which each law is valid."""
        values = self._all(self.coordinates.values(u), {})
        return self._in_lanes(valid_at, values, laws)

    @property
    def _laws(self) -> tuple[tuple[str, str], ...]:
        return tuple(sorted(self.laws.items()))

    def _all(self, values: np.ndarray, held: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the numbers in the order of the program."""
        of_fitted = dict(zip(self.coordinates.names, values.T, strict=True))
        known = {**self.held, **of_fitted, **held}
        columns = [np.broadcast_to(known[name], len(values)) for name in self.names]
        return np.stack(columns, 1).astype(float)

    def _in_lanes(self, program, values, laws):
        found = []
        for first in range(0, len(values), self.lanes):
            part = values[first : first + self.lanes]
            padding = np.repeat(part[-1:], self.lanes - len(part), 0)
            with jax.enable_x64(True):
                answer = program(
                    jnp.asarray(np.concatenate([part, padding])),
                    self.scene,
                    self.layout,
                    self.names,
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
        size = u.shape[1]
        steps = STEP * np.eye(size)
        parts = [self._scored(u[part], steps) for part in self.parts(len(u), size + 1)]
        total, slopes, known = map(np.concatenate, zip(*parts, strict=True))
        prior = self.coordinates.log_prior(u)
        of_prior = np.stack(
            [(self.coordinates.log_prior(u + s) - prior) / STEP for s in steps], axis=1
        )
        return Scored(
            self._total(total, prior),
            slopes + of_prior.clip(-20, 20),
            known + self.coordinates.information(),
        )

    def _scored(self, u: Float[np.ndarray, "place free"], steps: np.ndarray):
        """Return ln likelihood by kernel, slope and information of the best one."""
        rows, count = self.rows, len(u)
        seen = self.seen(np.concatenate([u, *(u + step for step in steps)]))
        here = _some(seen, np.arange(count))
        ends = seen.predicted[count:].reshape(len(steps), count, -1)
        jacobian = np.nan_to_num(np.moveaxis((ends - here.predicted) / STEP, 0, 2))
        by_kernel, field = log_likelihoods(np, rows, here, self.rounds)
        if len(rows.bound):
            satisfied = rows.is_bound & (field.residual[:, 0] < 0)
            readings = replace(rows, is_bound=np.zeros_like(rows.is_bound))
            loose = here._replace(record_sd=here.record_sd + 1e3 * satisfied)
            _, field = log_likelihoods(np, readings, loose, self.rounds)
            rows = readings
        normal = field.normal.at((np.arange(len(by_kernel)), by_kernel.argmax(1)))
        weights = np.nan_to_num(normal.weights(rows))
        solved = np.nan_to_num(normal.solved(rows, jacobian))
        return (
            by_kernel,
            np.einsum("mnj,mn->mj", jacobian, weights),
            _positive(np.swapaxes(jacobian, 1, 2) @ solved),
        )

    def exact(
        self, u: Float[np.ndarray, "draw free"], rng: np.random.Generator
    ) -> tuple[
        Float[np.ndarray, " draw"],
        Float[np.ndarray, " draw"],
        Float[np.ndarray, "draw name"],
        Float[np.ndarray, " draw"],
    ]:
        """Return ln of the density, of the exact one over it, numbers and validity.

        The ratio is an unbiased estimate. Linear numbers are drawn given the others.
        The validity is the share of the rows within the range of their laws.
        """
        values = self.coordinates.values(u)
        kernels, gains, valid = [], [], []
        scales = SCALES if self.has_few_rows else SCALES_OF_MANY
        work = scales // len(self.rows.kernels) + 1
        for part in self.parts(len(u), work):
            seen = self.seen_with(values[part])
            by_kernel, field = log_likelihoods(np, self.rows, seen, self.rounds)
            total = log_sum(by_kernel, axis=1)
            kernel = chosen(np.exp(by_kernel - total[:, None]), rng)
            approximate = by_kernel[np.arange(len(part)), kernel]
            gain, linear = exact_gain(
                self.rows, field, kernel, approximate, scales, rng
            )
            values[part[:, None], list(self.coordinates.linear)] += linear
            kernels.append(by_kernel)
            gains.append(gain)
            valid.append(seen.valid.mean(axis=1))
        density = self._total(np.concatenate(kernels), self.coordinates.log_prior(u))
        gain = np.nan_to_num(np.concatenate(gains), nan=0.0)
        return density, gain, values, np.concatenate(valid)

    def of_readings(
        self, values: Float[np.ndarray, "draw name"]
    ) -> Float[np.ndarray, " draw"]:
        """Return ln of the likelihood of given numbers, linear ones included."""
        rows = self.rows.of_all_numbers
        by_kernel = np.concatenate(
            [
                log_likelihoods(np, rows, self.seen_with(values[part]))[0]
                for part in self.parts(len(values))
            ]
        )
        return log_sum(by_kernel, axis=1) - math.log(by_kernel.shape[1])

    def best(self, u: Float[np.ndarray, " free"]) -> Float[np.ndarray, " name"]:
        """Return all numbers at coordinates, linear ones at their mean."""
        values = self.coordinates.values(u[None])
        by_kernel, field = log_likelihoods(np, self.rows, self.seen_with(values))
        size = len(self.coordinates.linear)
        mean = field.middle[0] + field.normal.linear[0, by_kernel[0].argmax(), :size]
        values[0, list(self.coordinates.linear)] += mean
        return values[0]

    def of_shot(self, shot: int) -> "Density":
        """Return the density by the rows of one charge alone."""
        out = np.array(self.layout.shot) != shot
        sigma = np.where(out, LEFT_OUT_SIGMA, self.rows.sigma)
        return replace(self, rows=replace(self.rows, sigma=sigma))

    def of_few(self, count: int) -> "Density":
        """Return the density by some of the rows if there are five times as many."""
        kinds: dict[tuple, list[int]] = {}
        layout, free = self.layout, self.coordinates.names
        own = [c if f"{CLOCK_OFFSET}.{c}" in free else "" for c in layout.clock]
        keys = zip(layout.quantity, layout.shot, own, strict=True)
        for row, kind in enumerate(keys):
            kinds.setdefault(kind, []).append(row)
        each = max(count // len(kinds), 2)
        if len(own) <= 5 * each * len(kinds):
            return self
        kept = np.concatenate(
            [
                np.array(of)[np.unique(np.linspace(0, len(of) - 1, each).astype(int))]
                for of in kinds.values()
            ]
        )
        log = some_rows(self.observations, np.sort(kept))
        return density_of(log, self.uncertain, self.noise).with_laws_of(self)

    def with_laws_of(self, other: "Density") -> "Density":
        """Return the density by the laws of another one."""
        if other.laws == self.laws:
            return self
        return self.with_laws(other.laws)

    def scene_at(self, values: Float[np.ndarray, " name"]) -> Scene:
        """Return the scene with given numbers."""
        return with_values(
            self.uncertain.scene, dict(zip(self.coordinates.names, values, strict=True))
        )

    def choices_at(self, values: Float[np.ndarray, " name"]) -> dict[str, TakenLaw]:
        """Return the automatic choice of laws at given numbers."""
        there = replace(self.scene_at(values), law=self.uncertain.scene.law)
        rows = layout_of(self.observations, there)
        return resolve_laws(there, rows, self.observations.error_scale())

    def with_laws(self, laws: Mapping[str, str]) -> "Density":
        """Return the density by other laws."""
        if laws == self.laws:
            return self
        named = dict(self.uncertain.scene.law)
        parts = _parts(self.observations, self.uncertain, {**named, **laws}, self.noise)
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
            for name in names_for(quantity)
            if is_candidate(law_for(quantity, name))
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
        return self.with_laws(found)

    def laws_at(
        self, u: Float[np.ndarray, "draw free"], weights: Float[np.ndarray, " draw"]
    ) -> dict[str, str]:
        """Return the automatic laws at the most probable draw.

        A law is exchanged only for one that is valid for no less of the draws.
        """
        best = self.coordinates.values(u[[weights.argmax()]])[0]
        new = law_names(self.choices_at(best))
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
    """Return the density of a log whose positions are resolved.

    Raises:
        InputError: A row has no error at all, a sigma disagrees with the covariance of
            its record, or rows times shared effects are too many.
    """
    scene = uncertain.scene
    parts = _parts(observations, uncertain, dict(scene.law), noise)
    names, beliefs = tuple(uncertain.beliefs), tuple(uncertain.beliefs.values())
    held = _held(scene, names)
    blank = Coordinates(
        names=names,
        beliefs=beliefs,
        base=_base(scene, names, beliefs, parts["layout"], parts["rows"]),
        places=_places(names, beliefs),
        others=(),
        linear=(),
        **_array(parts["layout"], parts["rows"]),
    )
    density = Density(
        observations=observations,
        uncertain=uncertain,
        coordinates=blank,
        names=tuple(sorted({*names, *held})),
        held=held,
        **parts,
    )
    return _with_linear_numbers(density)


def _held(scene: Scene, names: Sequence[str]) -> dict[str, float]:
    """Return numbers of the program that are not fitted."""
    bases = (*CHARGE_POSITION[:2], "origin_time_s", CLOCK_OFFSET, *WIND)
    found = {}
    for name in names_in(scene):
        if name.partition(".")[0] in bases and name not in names:
            value = value_of(scene, name)
            if value is not None:
                found[name] = float(value)
    ranged = {
        base + scene.label(charge)
        for charge in scene.charges
        if charge.range_m is not None
        for base in CHARGE_POSITION[:2]
    }
    return {name: value for name, value in found.items() if name not in ranged}


def _parts(
    observations: Observations,
    uncertain: UncertainScene,
    laws: Mapping[str, str],
    noise: Noise,
) -> dict[str, Any]:
    """Return scene, layout, laws and rows for a choice of laws."""
    named = replace(uncertain.scene, law=tuple(laws.items()))
    layout = layout_of(observations, named)
    taken = law_names(resolve_laws(named, layout, observations.error_scale()))
    scene, layout = jax.tree.map(
        lambda x: jnp.asarray(x) if isinstance(x, float) else x,
        (grounded(named, uncertain.beliefs), layout),
    )
    refuse_exact(observations, scene.scatter, taken)
    refuse_unresolved(observations)
    names = tuple(uncertain.beliefs)
    rows = _rows(observations, scene, layout, taken, names, noise)
    return {"scene": scene, "layout": layout, "laws": taken, "rows": rows}


def _rows(
    observations: Observations,
    scene: Scene,
    layout: Layout,
    laws: Mapping[str, str],
    names: Sequence[str],
    noise: Noise,
) -> Rows:
    sigma, shared = own_and_shared_errors(observations)
    refuse_vast(observations, scene, layout, laws, shared.shape[1])
    count, group = len(layout.quantity), np.array(layout.group)
    paths = {}
    for quantity, (shot, charge) in product(
        layout.quantities(), enumerate(scene.charges)
    ):
        of_shot, first, of = paths_of(layout, quantity, shot)
        if not len(of_shot):
            continue
        path, recorded = np.zeros(count, int), np.zeros(count, bool)
        path[of_shot], recorded[of_shot] = of, True
        paths[quantity + scene.label(charge)] = Paths(of_shot[first], path, recorded)
    most = max((len(one.first) for one in paths.values()), default=0)
    directed = ~(np.asarray(layout.slant_range) > 0)
    has_neighbours = len(set(group[directed])) > 1 and most > 1
    correlated = has_neighbours and most <= DENSE
    bases = {name.partition(".")[0] for name in names}
    # only the range of an array depends on the kernel
    weighted = correlated and bool(bases & {*CHARGE_POSITION})
    sharing = np.full(count, correlated)
    effects = effects_of(scene, layout, laws)
    for name, quantity, shot in effects.fields:
        if name in effects.path_loading:
            sharing[layout.rows(quantity, shot)[0]] = True
    label = np.zeros(count, int) if correlated else group
    block = _blocks(np.where(sharing, label, -1 - np.arange(count)), shared)
    members = np.maximum(block, 0)
    both = (block[:, :, None] >= 0) & (block[:, None] >= 0)
    return Rows(
        measured=np.asarray(to_error_scale(observations.value, layout.quantity)),
        sigma=sigma,
        circular=np.isin(layout.quantity, CIRCULAR),
        is_bound=observations.bounds(),
        group=group,
        block=block,
        shared=np.einsum("bme,bne->bmn", shared[members], shared[members]) * both,
        columns=np.zeros((count, 0)),
        precision=np.zeros(0),
        kernels=KERNELS if weighted else KERNELS[2:3],
        paths=paths,
        correlated=correlated,
        anchored=has_neighbours and DENSE < most <= MAX_PATHS,
        noise=noise,
    )


def _blocks(label: np.ndarray, shared: np.ndarray) -> np.ndarray:
    """Return the rows of each block: those of one label, and of its records."""
    for column in (shared != 0).T:  # a record of several labels joins them
        joined = np.unique(label[column])
        label[np.isin(label, joined)] = joined[0]
    _, label, size = np.unique(label, return_inverse=True, return_counts=True)
    block = np.full((len(size), size.max()), -1)
    order = np.argsort(label, kind="stable")
    member = np.arange(len(label)) - np.repeat(np.cumsum(size) - size, size)
    block[label[order], member] = order
    return block


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
    level = _sensors(layout)[:, :2]
    # the diagonal of the bounding box is at most the root of 2 times the width
    width = float(np.linalg.norm(np.ptp(level, axis=0)))
    if len(level) <= LANES:
        width = float(np.linalg.norm(level[:, None] - level[None], axis=-1).max())
    heard = _heard(layout, rows)
    radius = NEAR * (width or heard) or 1.0
    far = max(FAR * width, 10 * heard) or 1e5
    given = np.asarray(layout.time)
    # radii begin after the explosion; a clock reading has an error of its own
    timed = given[np.isfinite(given)]
    if not timed.size:
        timed = rows.measured[np.isin(layout.quantity, CLOCK_TIMES)]
    return {
        "middle": level.mean(0),
        "radius": radius,
        "most": math.asinh(far / radius),
        "first": float(timed.min()) if timed.size else math.nan,
    }


def _sensors(layout: Layout) -> Float[np.ndarray, "place 3"]:
    at = np.asarray(layout.places())
    return at if len(at) else np.zeros((1, 3))


def _heard(layout: Layout, rows: Rows) -> float:
    """Return how far sound travels between the times of a clock with an arrival [m]."""
    clock, quantity = np.array(layout.clock), np.array(layout.quantity)
    timed = np.asarray(layout.time)
    timed = np.where(np.isin(quantity, CLOCK_TIMES), rows.measured, timed)
    took = 0.0
    for name in set(layout.clock):
        of_clock = (clock == name) & np.isfinite(timed)
        bangs = np.isin(quantity, ARRIVALS) & of_clock
        if bangs.any():
            took = max(took, float(timed[bangs].max() - timed[of_clock].min()))
    return STANDARD_SOUND_SPEED * took


def _base(
    scene: Scene, names, beliefs, layout: Layout, rows: Rows
) -> Float[np.ndarray, " name"]:
    """Return the values at which numbers are held where they are linear."""
    clocks = np.isin(layout.quantity, CLOCK_TIMES)
    begin = float(rows.measured[clocks].min()) if clocks.any() else 0.0
    found = []
    for name, belief in zip(names, beliefs, strict=True):
        if not isinstance(belief, Free):
            found.append(float(belief.constrain(0.0)))
        elif name.startswith("origin_time_s"):
            found.append(begin)
        else:
            found.append(float(value_of(scene, name)))
    return np.array(found)


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
            probe[:, i] = blank.base[i] * np.exp(rng.normal(0, 1, PROBES))
    for pair in blank.places:
        away = rng.normal(0, blank.radius / NEAR, (PROBES, 2))
        probe[:, pair] = blank.middle + away
    turned = probe.copy()
    for pair in blank.places[:1]:
        away = (turned[:, pair] - blank.middle) @ np.array([[0.6, -0.8], [0.8, 0.6]])
        turned[:, pair] = blank.middle + away
    # one call: the places, the same in another bearing, each number moved by two steps
    sizes = (0.01, 2.0)
    moved = [
        probe - h * (np.arange(len(blank.names)) == i) for i in left for h in sizes
    ]
    seen = density.seen_with(np.concatenate([probe, turned, *moved])).predicted
    here, there, *ends = np.split(seen, 2 + len(moved))
    linear, columns, precision, others = [], [], [], []
    for k, i in enumerate(left):
        belief = blank.beliefs[i]
        slopes = np.concatenate(
            [(here - ends[2 * k + j]) / h for j, h in enumerate(sizes)]
        )
        if _is_linear(belief, slopes):
            linear.append(i)
            columns.append(slopes.mean(0).round(6))
            sd = math.inf
            if not isinstance(belief, Free):
                sd = float(belief.constrain(1.0) - belief.constrain(0.0))
            precision.append(sd**-2)
        else:
            others.append(_axis(density, i))
    found = np.stack(columns, 1) if columns else density.rows.columns
    flat = np.array(precision) == 0
    if np.linalg.matrix_rank(found[:, flat]) < flat.sum():
        # clocks of which the log has only differences: a wide normal keeps them finite
        wide = LOST * (reach_of(density) / STANDARD_SOUND_SPEED)
        precision = np.where(flat, wide**-2, precision).tolist()
    rows = replace(density.rows, columns=found, precision=np.array(precision))
    coordinates = replace(blank, linear=tuple(linear), others=tuple(others))
    is_round = len(blank.places) == 1 and np.allclose(here, there, rtol=1e-9, atol=0)
    return replace(density, coordinates=coordinates, rows=rows, is_round=is_round)


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


def _axis(density: Density, i: int) -> Other:
    """Return the coordinate of a number that is not linear."""
    axes, layout = density.coordinates, density.layout
    name, belief = axes.names[i], axes.beliefs[i]
    base, _, label = name.partition(".")
    if not isinstance(belief, Free):
        return Other(i, "score", -3.5, 3.5)
    if base == "charge_mass_kg":
        return Other(i, "flat", *MASS)
    if base == "origin_time_s":
        return Other(i, "time", math.log(1e-6), math.log(1e3))
    if base in CHARGE_POSITION:
        k = CHARGE_POSITION.index(base)
        labels = [axes.labels(place) for place in range(len(axes.places))]
        suffix = f".{label}" if label else ""
        place = labels.index(suffix) if suffix in labels else -1
        middle = float(np.append(axes.middle, _sensors(layout)[:, 2].mean())[k])
        fixed = [
            float(value_of(density.scene, other + suffix)) - axes.middle[j]
            for j, other in enumerate(CHARGE_POSITION[:2])
            if j != k
        ]
        most = 1.5 if k == 2 else axes.most
        kind = "height" if k == 2 else "axis"
        return Other(i, kind, -most, most, place, middle, float(np.linalg.norm(fixed)))
    amount, of = parameter_named(name).spread
    reach = reach_of(density)
    units = {"layout": reach, "travel": reach / STANDARD_SOUND_SPEED}
    half = SPREADS * (math.log(amount) if belief.positive else amount)
    half *= 1.0 if belief.positive else units.get(of, 1.0)
    middle = float(np.asarray(belief.unconstrain(axes.base[i])))
    return Other(i, "flat", middle - half, middle + half)


def reach_of(density: Density) -> float:
    """Return the width of the sensors, or the largest given slant range [m]."""
    given = np.nan_to_num(np.asarray(density.layout.slant_range)).max(initial=0.0)
    return max(float(given), density.coordinates.radius / NEAR)


def _positive(matrix: np.ndarray) -> np.ndarray:
    """Return matrices without the negative eigenvalues that rounding leaves."""
    values, vectors = np.linalg.eigh(matrix)
    return (vectors * np.maximum(values, 0.0)[:, None]) @ np.swapaxes(vectors, 1, 2)


def _some(seen: Seen, places: np.ndarray) -> Seen:
    return jax.tree.map(lambda x: x[places], seen)
