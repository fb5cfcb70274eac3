"""Moves of an ensemble of walkers, by emcee or inside one `lax.scan`.

Both engines make the same moves, in the proportions of `SHARES`. emcee evaluates all
walkers of a half step in one batch, and draws one kind of move per step. The `lax.scan`
has no Python between the steps: half of the walkers, drawn again each step, move by the
other half, then those by them, and the kind of each move is drawn by itself.

The independence move proposes a point from a mixture of normals about the known optima,
wherever the walker is. It leads from mode to mode if the search has found both, and
where the posterior is nearly normal it is nearly an independent draw.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float, PRNGKeyArray

from jblast.inference.whitening import Density, densities

SHARES = {"near": 0.7, "jump": 0.1, "stretch": 0.1, "independence": 0.1}
r"""Share of the moves of each kind.

near: $2.38/\sqrt{2 d}$ of the difference of two other walkers (ter Braak 2006, Stat.
Comput. 16:239). jump: the whole difference, which leads from mode to mode. stretch:
towards or away from another walker (Goodman & Weare 2010), for long tails.
independence: to a draw from the normals about the known optima (see `Mixture`). Five
microphones, four unknowns, 64 walkers: the autocorrelation time is 11 steps, without
the independence move 17, with the stretch move alone 59. For a normal of 12 unknowns it
is 13, 45 and 184. For a charge beside a line of microphones and its mirror image it is
36, without the independence move some 460.
"""
STRETCH = 2.0
"""Largest factor of the stretch move; the smallest is its inverse. The value of Goodman
& Weare (2010), which emcee uses as well."""
JITTER = 1e-5
"""Relative standard deviation of the length of a difference. With an exact length the
walkers could only reach a lattice."""
BLOCK = 100
"""Steps in one compiled call, which Ctrl-C cannot interrupt."""


class WalkState(NamedTuple):
    """State of the ensemble.

    Attributes:
        walkers: Positions of the walkers.
        log_density: ln of the density at each.
        random: State of the random numbers.
    """

    walkers: Float[np.ndarray, "walker free"]
    log_density: Float[np.ndarray, " walker"]
    random: Mapping[str, np.ndarray]


class Segment(NamedTuple):
    """Consecutive steps of a chain.

    Attributes:
        chain: Positions after each step.
        log_density: ln of the density at each.
        random: State of the random numbers after the last step.
        interrupted: True if Ctrl-C ended it early.
    """

    chain: Float[np.ndarray, "step walker free"]
    log_density: Float[np.ndarray, "step walker"]
    random: Mapping[str, np.ndarray]
    interrupted: bool = False

    @property
    def end(self) -> WalkState:
        """State of the ensemble after the last step."""
        return WalkState(self.chain[-1], self.log_density[-1], self.random)


class Mixture(eqx.Module):
    r"""A mixture of normals $q(w) = \sum_k s_k N(w; c_k, A_k A_k^T)$.

    Attributes:
        center: Means $c_k$.
        root: One standard deviation along each axis $A_k$, one column each.
        inverse: $A_k^{-1}$.
        share: Weight of each normal $s_k$; the sum is 1.
        log_height: ln of the density of each at its mean, up to a constant.
    """

    center: Float[Array, "normal free"]
    root: Float[Array, "normal free free"]
    inverse: Float[Array, "normal free free"]
    share: Float[Array, " normal"]
    log_height: Float[Array, " normal"]

    def log_density(self, w: Float[Array, " free"]) -> Float[Array, ""]:
        """Return ln of the density at a place, up to a constant."""
        u = jnp.einsum("kij,kj->ki", self.inverse, w[None, :] - self.center)
        return jax.nn.logsumexp(self.log_height - 0.5 * jnp.sum(u**2, axis=1))


@runtime_checkable
class Engine(Protocol):
    """A sampler that moves the walkers."""

    @property
    def tick_steps(self) -> int:
        """Steps from one call of `tick` to the next."""
        ...

    def first_random(self, seed: int) -> Mapping[str, np.ndarray]:
        """Return the initial state of the random numbers, as arrays."""
        ...

    def walk(
        self,
        density: Density,
        mixture: Mixture,
        state: WalkState,
        steps: int,
        tick: Callable[[], None],
    ) -> Segment:
        """Continue the chain; Ctrl-C ends the segment early.

        Args:
            density: The density to sample.
            mixture: Normals about its known optima.
            state: State of the ensemble.
            steps: Number of steps.
            tick: Function that is called after every `tick_steps` steps.
        """
        ...


def moves(mixture: Mixture) -> list:
    """Return emcee's moves, each with its share."""
    # imported here: fits without walkers do without it
    from emcee.moves import DEMove, MHMove, StretchMove

    def draw_independent(w, random):
        rank, unit = random.uniform(size=len(w)), random.standard_normal(w.shape)
        there, factor = independence_move(mixture, *map(jnp.asarray, (w, rank, unit)))
        return np.asarray(there, float), np.asarray(factor, float)

    return [
        (DEMove(), SHARES["near"]),
        (DEMove(gamma0=1.0), SHARES["jump"]),
        (StretchMove(), SHARES["stretch"]),
        (MHMove(draw_independent), SHARES["independence"]),
    ]


class Emcee:
    """An ensemble that emcee moves."""

    tick_steps = 1

    def first_random(self, seed: int) -> dict[str, np.ndarray]:
        """Return the initial state of emcee's random numbers, as arrays."""
        state = np.random.MT19937(seed).state["state"]
        return {
            "key": np.asarray(state["key"], np.uint32),
            "place": np.array([state["pos"], 0]),
            "normal": np.array(0.0),
        }

    def walk(
        self,
        density: Density,
        mixture: Mixture,
        state: WalkState,
        steps: int,
        tick: Callable[[], None],
    ) -> Segment:
        """Continue the chain; Ctrl-C ends the segment after the last complete step."""
        import emcee  # see `moves`

        walkers, free = state.walkers.shape
        sampler = emcee.EnsembleSampler(
            walkers,
            free,
            lambda w: np.asarray(densities(density, w), float),
            moves=moves(mixture),
            vectorize=True,
        )
        random = state.random
        position, has_normal = (int(x) for x in random["place"])
        normal = float(random["normal"])
        start = emcee.State(
            state.walkers,
            log_prob=state.log_density,
            random_state=("MT19937", random["key"], position, has_normal, normal),
        )
        done: list[tuple] = []
        interrupted = False
        try:
            for now in sampler.sample(
                start, iterations=steps, store=False, skip_initial_state_check=True
            ):
                both = now.coords.copy(), np.array(now.log_prob)
                done.append((*both, now.random_state))
                tick()
        except KeyboardInterrupt:
            interrupted = True
        return Segment(
            np.array([coords for coords, *_ in done]).reshape(-1, walkers, free),
            np.array([value for _, value, _ in done]).reshape(-1, walkers),
            _arrays(done[-1][2]) if done else state.random,
            interrupted,
        )


def _arrays(state) -> dict[str, np.ndarray]:
    _, key, position, has_normal, normal = state
    return {
        "key": np.asarray(key, np.uint32),
        "place": np.array([position, has_normal]),
        "normal": np.array(normal),
    }


class Scan:
    """An ensemble whose moves are compiled."""

    tick_steps = BLOCK

    def first_random(self, seed: int) -> dict[str, np.ndarray]:
        """Return the initial state of the random numbers, as arrays."""
        return {"seed": np.array(seed), "step": np.array(0)}

    def walk(
        self,
        density: Density,
        mixture: Mixture,
        state: WalkState,
        steps: int,
        tick: Callable[[], None],
    ) -> Segment:
        """Continue the chain; Ctrl-C discards the current block."""
        w, value = jnp.asarray(state.walkers), jnp.asarray(state.log_density)
        # each step folds its number into the key: a resumed chain draws the same
        # numbers
        key = jax.random.key(int(state.random["seed"]))
        first = int(state.random["step"])
        chain, log_density = [], []
        interrupted = False
        try:
            for start in range(first, first + steps, BLOCK):
                (w, value), (places, values) = _block(
                    density, mixture, w, value, key, jnp.asarray(start)
                )
                both = np.asarray(places), np.asarray(values)
                chain.append(both[0])
                log_density.append(both[1])
                tick()
        except KeyboardInterrupt:
            interrupted = True
        # a last block may be longer than the segment: one size is compiled, and the
        # rest is cut off
        done = min(len(log_density) * BLOCK, steps)
        shape = state.walkers.shape
        return Segment(
            np.concatenate([np.zeros((0, *shape)), *chain])[:done],
            np.concatenate([np.zeros((0, shape[0])), *log_density])[:done],
            {**state.random, "step": np.array(first + done)},
            interrupted,
        )


@jax.jit
def _block(density, mixture, w, value, key, first):
    def step(carry, number):
        moved = _step(jax.random.fold_in(key, number), density, mixture, *carry)
        return moved, moved

    return lax.scan(step, (w, value), first + jnp.arange(BLOCK))


def _step(key: PRNGKeyArray, density, mixture, w: Float[Array, "walker free"], value):
    """Move every walker once."""
    shuffle_key, *keys = jax.random.split(key, 3)
    order = jax.random.permutation(shuffle_key, len(w))
    # Detailed balance: walkers of one half move by the positions of the other half,
    # which stay fixed meanwhile (Foreman-Mackey et al. 2013).
    half = len(w) // 2
    for key, mine, others in (
        (keys[0], order[:half], order[half:]),
        (keys[1], order[half:], order[:half]),
    ):
        propose_key, accept_key = jax.random.split(key)
        there, factor = _proposal(propose_key, mixture, w[mine], w[others])
        found = densities(density, there)
        gain = factor + found - value[mine]
        accepted = gain > jnp.log(jax.random.uniform(accept_key, gain.shape))
        w = w.at[mine].set(jnp.where(accepted[:, None], there, w[mine]))
        value = value.at[mine].set(jnp.where(accepted, found, value[mine]))
    return w, value


def _proposal(key: PRNGKeyArray, mixture, mine, others):
    """Propose a place for each walker, and return ln of the Hastings factor."""
    count, free = mine.shape
    kind, one, two, long, far, which, where = jax.random.split(key, 7)
    first = jax.random.randint(one, (count,), 0, len(others))
    apart = jax.random.randint(two, (count,), 1, len(others))
    second = (first + apart) % len(others)  # never the same as the first
    jitter = 1 + JITTER * jax.random.normal(long, (count,), mine.dtype)
    # inverse distribution function of g(s) ~ 1 / sqrt(s) on [1/STRETCH, STRETCH]
    uniform = jax.random.uniform(far, (count,), mine.dtype)
    stretch = jnp.square((STRETCH - 1) * uniform + 1)
    stretch = (stretch / STRETCH)[:, None]

    u = jax.random.uniform(kind, (count, 1), mine.dtype)
    is_stretch = u < SHARES["stretch"]
    is_jump = u < SHARES["stretch"] + SHARES["jump"]
    is_independent = u > 1 - SHARES["independence"]
    length = jnp.where(is_jump, 1.0, 2.38 / (2 * free) ** 0.5) * jitter[:, None]
    by_difference = mine + length * (others[first] - others[second])
    by_stretch = others[first] + stretch * (mine - others[first])
    rank = jax.random.uniform(which, (count,), mine.dtype)
    unit = jax.random.normal(where, mine.shape, mine.dtype)
    there, of_mixture = independence_move(mixture, mine, rank, unit)
    there = jnp.where(
        is_independent, there, jnp.where(is_stretch, by_stretch, by_difference)
    )
    # volume of the stretch move: s^(d-1) (Goodman & Weare 2010)
    of_stretch = jnp.where(is_stretch, (free - 1) * jnp.log(stretch), 0.0)[:, 0]
    return there, jnp.where(is_independent[:, 0], of_mixture, of_stretch)


def mixture_of(
    center: Float[np.ndarray, "normal free"],
    root: Float[np.ndarray, "normal free free"],
    share: Float[np.ndarray, " normal"],
) -> Mixture:
    """Return a mixture of normals; shares are normalised."""
    share = share / share.sum()
    log_height = np.log(share) - np.linalg.slogdet(root)[1]
    # inverted once: a LAPACK solve in every step costs more than the step
    arrays = center, root, np.linalg.inv(root), share, log_height
    return Mixture(*map(jnp.asarray, arrays))


@jax.jit
def independence_move(
    mixture: Mixture,
    w: Float[Array, "walker free"],
    rank: Float[Array, " walker"],
    unit: Float[Array, "walker free"],
) -> tuple[Float[Array, "walker free"], Float[Array, " walker"]]:
    r"""Propose a place for each walker that is independent of its position.

    Args:
        mixture: Distribution of the proposals $q$.
        w: Positions of the walkers.
        rank: Uniform between 0 and 1; selects the normal of the mixture.
        unit: Standard normals, transformed by it.

    Returns:
        The places $w'$, and $\ln q(w) - \ln q(w')$, which is added to ln of the ratio
        of densities (Hastings 1970, Biometrika 57:97).
    """
    of = jnp.searchsorted(jnp.cumsum(mixture.share)[:-1], rank)
    there = mixture.center[of] + jnp.einsum("nij,nj->ni", mixture.root[of], unit)
    log_density = jax.vmap(mixture.log_density)
    return there, log_density(w) - log_density(there)
