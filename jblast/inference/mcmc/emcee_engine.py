"""The walk of an ensemble by emcee, all walkers of a half step in one batch."""

from collections.abc import Callable, Mapping

import jax.numpy as jnp
import numpy as np

from jblast.inference.importance.whitening import Density, densities
from jblast.inference.mcmc.independence_move import Mixture, independence_move
from jblast.inference.mcmc.state import SHARES, Segment, WalkState


def moves(mixture: Mixture) -> list:
    """Return emcee's moves, each with its share."""
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
        """Return what emcee's random numbers start from, as arrays."""
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
        """Walk on; Ctrl-C ends the stretch after the last whole step."""
        import emcee

        walkers, free = state.walkers.shape
        sampler = emcee.EnsembleSampler(
            walkers,
            free,
            lambda w: np.asarray(densities(density, w), float),
            moves=moves(mixture),
            vectorize=True,
        )
        start = emcee.State(
            state.walkers,
            log_prob=state.log_density,
            random_state=of_emcee(state.random),
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


def of_emcee(random: Mapping[str, np.ndarray]) -> tuple:
    """Return the state of random numbers as emcee takes it."""
    position, has_normal = (int(x) for x in random["place"])
    return "MT19937", random["key"], position, has_normal, float(random["normal"])


def _arrays(state) -> dict[str, np.ndarray]:
    _, key, position, has_normal, normal = state
    return {
        "key": np.asarray(key, np.uint32),
        "place": np.array([position, has_normal]),
        "normal": np.array(normal),
    }
