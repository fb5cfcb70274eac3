"""A policy learns to hold a place through blasts, beside the SE(3) hold.

    python -m calibration.learned_hold --out calibration/results/learned_hold.png
        > calibration/results/learned_hold.txt

An Iris hovers; each episode of 4 s has a blast of 5 to 15 kg of TNT, 8 to 25 m off,
and a wind of up to 2 m/s either way. The policy moves the place that the SE(3) hold
holds, by up to 2 m, a hundred times a second (the command `hold`): it begins as the
hold, and learns by proximal policy optimisation (`calibration.ppo`) what else to do
about a blast. Then both fly through blasts that nobody trained on, drawn from another
seed, the same for both, and the greatest distance from the place is compared, blast by
blast. The policy acts by its mean. The hold has integral action and the gains it comes
with.
"""

import argparse
import os
import time
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from calibration.ppo import Settings, Weights, begin, iterate, policy
from jblast.cli.jax_start import start_jax
from jblast.environments import (
    EnvironmentParams,
    Randomisation,
    environment_params,
    reset_lanes,
    step_lanes,
)
from jblast.report.figure_style import BLUE, VERMILLION, new_figure, quiet, titled
from jblast.scene import ByCount, Ring, Uniform, WorldSpec

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


if __name__ == "__main__":
    main()
