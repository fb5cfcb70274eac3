# pyright: reportMissingImports=false
# The other simulator lives in an environment of its own.
"""Environment steps a second beside crazyflow's own environment, in one run.

    python -m calibration.environments_beside OTHER_PYTHON
        > calibration/results/environments_beside.txt

OTHER_PYTHON has crazyflow, which wants another release of JAX. Both take 4,096 lanes
through steps in single precision on all cores, in turns, each three times a turn; wall
time and processor time of the best. jblast's is one of 10 ms with position hold, two
blasts in an episode, observation, reward and autoreset (`benchmark_environments`), 200
of them compiled as one program. crazyflow's is `ReachPosEnv.step` as it comes, one call
each, its actions sampled beforehand: at 500 Hz a step of 2 ms, and at 100 Hz one of 10
ms in five.
"""

import json
import os
import subprocess
import sys
import tempfile
import time

ROUNDS, LANES, STEPS = 2, 4096, 200
RATES_HZ = (500, 100)


def crazyflow_rates() -> dict[str, tuple[float, float]]:
    """Return crazyflow's steps a second, of the wall and of processors."""
    import jax
    from crazyflow.envs.reach_pos_env import ReachPosEnv

    found = {}
    for rate in RATES_HZ:
        env = ReachPosEnv(num_envs=LANES, freq=rate)
        env.reset(seed=0)
        action = env.action_space.sample()

        def go(env: ReachPosEnv = env, action: object = action) -> None:
            for _ in range(STEPS - 1):
                env.step(action)
            jax.block_until_ready(env.step(action)[:4])

        found[f"crazyflow, {rate} Hz"] = _timed(go)
    return found


def jblast_rates() -> dict[str, tuple[float, float]]:
    """Return jblast's."""
    from jblast.cli.jax_start import start_jax

    start_jax(all_cores=True)
    import jax

    from calibration.benchmark_environments import begun, rollout
    from jblast.environments import environment_params
    from jblast.environments.lanes import CHUNK

    jax.config.update("jax_enable_x64", False)
    params = environment_params("Hover", command="hold")
    devices = len(jax.devices())
    states = begun(params, LANES)
    program = rollout(CHUNK, devices).lower(states, params).compile()

    def go() -> None:
        jax.block_until_ready(program(states, params))

    return {"jblast, 100 Hz": _timed(go)}


def _timed(go) -> tuple[float, float]:
    go()
    wall = cores = float("inf")
    for _ in range(3):
        start, spent = time.perf_counter(), time.process_time()
        go()
        wall = min(wall, time.perf_counter() - start)
        cores = min(cores, time.process_time() - spent)
    return LANES * STEPS / wall, LANES * STEPS / cores


def main(other: str) -> str:
    """Measure in turns, and return what is kept."""
    best: dict[str, list[float]] = {}
    for _ in range(ROUNDS):
        for python, which in ((sys.executable, "jblast"), (other, "crazyflow")):
            command = [python, os.path.abspath(__file__), "--only", which]
            # crazyflow's physics leaves a log where it runs
            with tempfile.TemporaryDirectory() as folder:
                said = subprocess.run(
                    command, check=True, capture_output=True, text=True, cwd=folder
                )
            for name, rates in json.loads(said.stdout.splitlines()[-1]).items():
                known = best.setdefault(name, [0.0, 0.0])
                best[name] = [max(a, b) for a, b in zip(known, rates, strict=True)]
    lines = [
        f"{LANES:,} lanes, float32, all cores, best of {ROUNDS} turns of three",
        f"{'environment':<22}{'steps/s':>12}{'of a core-second':>20}",
    ]
    lines += [
        f"{n:<22}{wall:>12.3g}{cores:>20.3g}" for n, (wall, cores) in best.items()
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    if sys.argv[1] == "--only":
        rates = jblast_rates() if sys.argv[2] == "jblast" else crazyflow_rates()
        sys.stdout.write(json.dumps(rates) + "\n")
    else:
        sys.stdout.write(main(sys.argv[1]))
