"""A policy learns to hold a place through blasts, beside the SE(3) hold.

    python -m calibration.learned_hold --out calibration/results/learned_hold.png
        > calibration/results/learned_hold.txt

An Iris hovers; each episode of 4 s has a blast of 5 to 15 kg of TNT, 8 to 25 m off,
and a wind of up to 2 m/s either way. The policy moves the place that the SE(3) hold
holds, by up to 2 m, a hundred times a second (the command `hold`): it begins as the
hold, and learns by proximal policy optimisation what else to do
about a blast. Then both fly through blasts that nobody trained on, drawn from another
seed, the same for both, and the greatest distance from the place is compared, blast by
blast. The policy acts by its mean. The hold has integral action and the gains it comes
with.

Schulman et al. (2017), with generalised advantages (Schulman et al. 2016) and Adam
(Kingma and Ba 2015). Two networks of two layers of 64; the policy is a normal whose
spread does not depend on what is seen; its steps of learning shorten evenly to a
twentieth. The step after an episode's end begins the next one (`NEXT_STEP`): it is left
out of all sums.
"""

import argparse
import os
import time
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PRNGKeyArray
from matplotlib.figure import Figure

from jblast.cli.jax_start import start_jax
from jblast.environments import (
    EnvironmentParams,
    Randomisation,
    environment_params,
    reset_lanes,
    step_lanes,
)
from jblast.environments.core import actions_of
from jblast.report.figure_style import BLUE, VERMILLION, new_figure, quiet, titled
from jblast.scene import ByCount, Ring, Uniform, WorldSpec

Weights = Any


class Settings(NamedTuple):
    """How it learns.

    Attributes:
        lanes: Environments at once.
        horizon: Steps of each between two rounds of learning.
        iterations: Rounds.
        epochs: Times that a round looks at each step.
        batches: Parts it takes them in.
        rate: First step of Adam.
        discount: Of the reward a step later.
        trace: Of advantages, lambda.
        clip: Most that a round may change a probability, as a share.
        value_share: Weight of the value's error beside the policy's gain.
        spread: Logarithm of the policy's first standard deviation.
    """

    lanes: int = 512
    horizon: int = 64
    iterations: int = 250
    epochs: int = 4
    batches: int = 8
    rate: float = 3e-4
    discount: float = 0.98
    trace: float = 0.95
    clip: float = 0.2
    value_share: float = 0.5
    spread: float = -2.3


class Rows(NamedTuple):
    """What was seen, done and earned, a row a step and lane."""

    seen: Array
    action: Array
    log_density: Array
    value: Array
    reward: Array
    over: Array
    terminated: Array
    counts: Array


class Learner(NamedTuple):
    """What goes on from iteration to iteration."""

    weights: Weights
    mean: Weights
    square: Weights
    updates: Array
    states: Any
    seen: Array
    fresh: Array
    key: PRNGKeyArray


EPISODE_S, LANES, SEED, UNSEEN = 4.0, 400, 0, 10_000
SECONDS = 240.0
"""Of training; after them what was learnt is compared."""

SCALE = np.repeat([5.0, 2.0, 2.0, 0.5], [3, 3, 9, 3])
"""Of what is seen: place, velocity, attitude, body rates; declared."""


class Learnt(NamedTuple):
    """What training gave.

    Attributes:
        weights: Of the policy.
        seconds: After each iteration, of the wall, compilation included.
        cores: Likewise, of processors.
        reward: Of a step, mean of the iteration.
        peak_m: Mean peak deviation of the episodes that ended; NaN: none did.
    """

    weights: Weights
    seconds: np.ndarray
    cores: np.ndarray
    reward: np.ndarray
    peak_m: np.ndarray


def params_of() -> EnvironmentParams:
    """Return the environment."""
    world = WorldSpec(
        occurrence=ByCount(1),
        region=Ring(8.0, 25.0),
        about="vehicle",
        mass=Uniform(5.0, 15.0),
        time=Uniform(0.5, 2.0),
    )
    wind = Uniform(-2.0, 2.0)
    return environment_params(
        "Hover",
        command="hold",
        world=world,
        randomisation=Randomisation(wind_east_m_s=wind, wind_north_m_s=wind),
        spread_m=0.02,
        episode_s=EPISODE_S,
    )


def learnt(params: EnvironmentParams, how: Settings, seconds: float) -> Learnt:
    """Train for all iterations, or until a time is over."""
    start, spent = time.perf_counter(), time.process_time()
    scale = jnp.asarray(SCALE)
    learner = jax.jit(lambda key: begin(key, params, scale, how))(jax.random.key(SEED))
    go_on = jax.jit(lambda learner: iterate(learner, params, how), donate_argnums=0)
    rows = []
    for _ in range(how.iterations):
        learner, (reward, peak) = jax.block_until_ready(go_on(learner))
        wall = time.perf_counter() - start
        rows.append((wall, time.process_time() - spent, float(reward), float(peak)))
        if wall > seconds:
            break
    return Learnt(learner.weights, *np.array(rows).T)


def peaks(params: EnvironmentParams, weights: Weights) -> tuple[np.ndarray, np.ndarray]:
    """Return how far hold and policy are thrown by unseen blasts [m].

    Args:
        params: Of the environment.
        weights: Of the policy.
    """

    def fly(now: tuple, _: None) -> tuple[tuple, jax.Array]:
        states, seen, share = now
        found = step_lanes(states, share * policy(weights, seen), params)
        # of its last step, or of its end before
        return (found.state, found.observation, share), found.info["peak_deviation_m"]

    @jax.jit
    def farthest(share: jax.Array) -> jax.Array:
        begun = reset_lanes(jax.random.key(UNSEEN), jnp.arange(LANES), params)
        steps = int(params.episode_steps)
        return jnp.max(jax.lax.scan(fly, (*begun, share), None, steps)[1], axis=0)

    hold, own = (np.asarray(farthest(jnp.asarray(share))) for share in (0.0, 1.0))
    return hold, own


def table(found: Learnt, how: Settings, hold: np.ndarray, own: np.ndarray) -> str:
    """Return what is printed."""
    steps = how.lanes * how.horizon * len(found.seconds)
    lines = [
        f"PPO, {how.lanes} lanes, {len(found.seconds)} iterations of {how.horizon} "
        f"steps: {steps:.3g} steps in {found.seconds[-1]:.0f} s of the wall, "
        f"{found.cores[-1]:.0f} s of processors, compilation included; {os.cpu_count()}"
        f" cores, load average {os.getloadavg()[0]:.1f}",
        f"reward of a step: {found.reward[0]:.3f} at first, {found.reward[-1]:.3f}",
        f"peak deviation [m] in {LANES} unseen blasts:",
        f"{'':16}{'median':>10}{'90 %':>10}{'greatest':>10}",
    ]
    for name, peaks in (("SE(3) hold", hold), ("policy", own)):
        numbers = (np.median(peaks), np.quantile(peaks, 0.9), peaks.max())
        lines.append(f"{name:16}" + "".join(f"{x:>10.3f}" for x in numbers))
    ratio = own / hold
    lines.append(
        f"policy over hold, blast by blast: median {np.median(ratio):.3f}, smaller in "
        f"{np.mean(ratio < 1):.3f} of them"
    )
    return "\n".join(lines)


def figure(found: Learnt, hold: np.ndarray, own: np.ndarray) -> Figure:
    """Draw the learning curve, and both peaks of each blast."""
    drawn = new_figure(9.0, 3.6)
    left, right = drawn.subplots(1, 2)
    left.plot(found.cores, found.reward, color=BLUE)
    left.set_xlabel("processor time [s]")
    left.set_ylabel("reward of a step")
    quiet(left)
    titled(left, "It learns to hold")
    most = 1.05 * float(max(hold.max(), own.max()))
    right.plot([0, most], [0, most], color="0.7", linewidth=1)
    right.plot(hold, own, ".", color=VERMILLION, markersize=3)
    right.set_xlabel("peak deviation of the SE(3) hold [m]")
    right.set_ylabel("of the policy [m]")
    quiet(right)
    titled(right, f"{len(hold)} blasts that nobody trained on")
    return drawn


def main() -> None:
    """Train, compare, print and draw."""
    parser = argparse.ArgumentParser(description="Learn to hold through blasts.")
    parser.add_argument("--out", type=Path, help="the figure")
    parser.add_argument("--iterations", type=int, default=Settings().iterations)
    parser.add_argument("--seconds", type=float, default=SECONDS)
    asked = parser.parse_args()
    start_jax()
    how = Settings(iterations=asked.iterations)
    params = params_of()
    found = learnt(params, how, asked.seconds)
    hold, own = peaks(params, found.weights)
    print(table(found, how, hold, own))
    if asked.out is not None:
        figure(found, hold, own).savefig(asked.out)


def new_weights(
    key: PRNGKeyArray, scale: Array, actions: int, spread: float
) -> Weights:
    """Return networks of policy and value, logarithm of the spread, and the scale.

    Args:
        key: Of what the networks begin with.
        scale: Factors that bring what is seen to about one; they are not learnt.
        actions: Numbers of an action.
        spread: Logarithm of the first standard deviation.
    """

    def net(key: PRNGKeyArray, last: int, end: float) -> list[tuple[Array, Array]]:
        sizes = (len(scale), 64, 64, last)
        gains = (1.0, 1.0, end)
        keys = jax.random.split(key, 3)
        return [
            (g * jax.random.normal(k, (a, b)) / jnp.sqrt(a), jnp.zeros(b))
            for k, a, b, g in zip(keys, sizes, sizes[1:], gains, strict=False)
        ]

    first, second = jax.random.split(key)
    spreads = jnp.full(actions, spread)
    return net(first, actions, 0.01), net(second, 1, 1.0), spreads, scale


def policy(weights: Weights, seen: Array) -> Array:
    """Return the mean action."""
    return _net(weights[0], seen * jax.lax.stop_gradient(weights[3]))


def _net(layers: list[tuple[Array, Array]], x: Array) -> Array:
    for matrix, offset in layers[:-1]:
        x = jnp.tanh(x @ matrix + offset)
    return x @ layers[-1][0] + layers[-1][1]


def _value(weights: Weights, seen: Array) -> Array:
    return _net(weights[1], seen * jax.lax.stop_gradient(weights[3]))[..., 0]


def _log_density(weights: Weights, seen: Array, action: Array) -> Array:
    off = (action - policy(weights, seen)) * jnp.exp(-weights[2])
    return -jnp.sum(0.5 * off * off + weights[2], axis=-1)


def begin(
    key: PRNGKeyArray, params: EnvironmentParams, scale: Array, how: Settings
) -> Learner:
    """Return a learner that has learnt nothing."""
    first, second, third = jax.random.split(key, 3)
    states, seen = reset_lanes(first, jnp.arange(how.lanes), params)
    weights = new_weights(second, scale, actions_of(params), how.spread)
    none = jax.tree.map(jnp.zeros_like, weights)
    fresh = jnp.zeros(how.lanes, bool)
    return Learner(weights, none, none, jnp.zeros(()), states, seen, fresh, third)


def iterate(
    learner: Learner, params: EnvironmentParams, how: Settings
) -> tuple[Learner, tuple[Array, Array]]:
    """Fly some steps, and learn from them.

    Returns:
        The learner, and of these steps: mean reward, and mean over the episodes that
        ended of their peak deviation (NaN: none ended).
    """
    key, noise, order = jax.random.split(learner.key, 3)
    weights = learner.weights

    def fly(now: tuple, key: PRNGKeyArray) -> tuple[tuple, tuple[Rows, Array]]:
        states, seen, fresh = now
        mean = policy(weights, seen)
        action = mean + jnp.exp(weights[2]) * jax.random.normal(key, mean.shape)
        found = step_lanes(states, action, params)
        over = found.terminated | found.truncated
        rows = Rows(
            seen,
            action,
            _log_density(weights, seen, action),
            _value(weights, seen),
            found.reward,
            over,
            found.terminated,
            ~fresh,
        )
        return (found.state, found.observation, over), (
            rows,
            found.info["peak_deviation_m"],
        )

    now = (learner.states, learner.seen, learner.fresh)
    now, (rows, peaks) = jax.lax.scan(fly, now, jax.random.split(noise, how.horizon))

    def back(carried: tuple[Array, Array], row: Rows) -> tuple[tuple, Array]:
        after, gathered = carried
        follows = jnp.where(row.terminated, 0.0, after)
        earned = (1 - how.discount) * row.reward  # so that values are about 1
        error = earned + how.discount * follows - row.value
        keeps = jnp.where(row.over, 0.0, how.discount * how.trace)
        gain = error + keeps * gathered
        return (row.value, gain), gain

    last = (_value(weights, now[1]), jnp.zeros(how.lanes))
    _, gains = jax.lax.scan(back, last, rows, reverse=True)
    flat = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), (rows, gains))
    order = jax.vmap(lambda k: jax.random.permutation(k, gains.size))(
        jax.random.split(order, how.epochs)
    ).reshape(how.epochs * how.batches, -1)

    def learn(carried: tuple, places: Array) -> tuple[tuple, None]:
        part = jax.tree.map(lambda x: x[places], flat)
        return _adam(carried, jax.grad(_loss)(carried[0], *part, how), how), None

    carried = (weights, learner.mean, learner.square, learner.updates)
    carried, _ = jax.lax.scan(learn, carried, order)
    ended = jnp.sum(rows.over)
    reward = jnp.sum(rows.reward * rows.counts) / jnp.sum(rows.counts)
    peak = jnp.sum(jnp.where(rows.over, peaks, 0.0)) / ended
    return Learner(*carried, *now, key), (reward, peak)


def _loss(weights: Weights, rows: Rows, gains: Array, how: Settings) -> Array:
    counts = rows.counts.astype(gains.dtype)
    whole = jnp.sum(counts)
    mean = jnp.sum(gains * counts) / whole
    spread = jnp.sqrt(jnp.sum(counts * (gains - mean) ** 2) / whole) + 1e-6
    scaled = (gains - mean) / spread
    ratio = jnp.exp(_log_density(weights, rows.seen, rows.action) - rows.log_density)
    clipped = jnp.clip(ratio, 1 - how.clip, 1 + how.clip)
    gained = jnp.minimum(ratio * scaled, clipped * scaled)
    miss = _value(weights, rows.seen) - (rows.value + gains)
    return jnp.sum(counts * (how.value_share * miss * miss - gained)) / whole


def _adam(carried: tuple, slope: Weights, how: Settings) -> tuple:
    weights, mean, square, count = carried
    size = jnp.sqrt(sum(jnp.sum(g * g) for g in jax.tree.leaves(slope)))
    slope = jax.tree.map(lambda g: g * jnp.minimum(1.0, 0.5 / (size + 1e-9)), slope)
    count = count + 1
    mean = jax.tree.map(lambda m, g: 0.9 * m + 0.1 * g, mean, slope)
    square = jax.tree.map(lambda s, g: 0.999 * s + 0.001 * g * g, square, slope)
    first, second = 1 - 0.9**count, 1 - 0.999**count
    done = count / (how.iterations * how.epochs * how.batches)
    rate = how.rate * jnp.maximum(0.05, 1 - done)
    weights = jax.tree.map(
        lambda w, m, s: w - rate * m / first / (jnp.sqrt(s / second) + 1e-8),
        weights,
        mean,
        square,
    )
    return weights, mean, square, count


if __name__ == "__main__":
    main()
