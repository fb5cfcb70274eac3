# pyright: reportMissingImports=false
# The other simulators live in environments of their own.
"""Flights and environment steps a second: jblast beside RotorPy and crazyflow.

    python -m calibration.other_simulators OTHER_PYTHON...
        > calibration/results/flight_simulators.txt
    python -m calibration.other_simulators environments OTHER_PYTHON
        > calibration/results/environments_beside.txt

Each interpreter measures the simulators that are installed in its environment, one
after another; jblast's and crazyflow's want different releases of JAX. RotorPy's
batched vehicles want torch, torchdiffeq and roma beside it.

Crazyflies fly from hover, all cores, each simulator at its own default step and in its
own precision, and jblast at RotorPy's and crazyflow's too. "rotor speeds": constant
ones; "hold": a position hold, asked at every step but crazyflow's, asked 100 times a
second for place and 500 for attitude. crazyflow has no wind, and RotorPy's stands still
within a step; jblast's is still air, or a blast of 1 kg of TNT 5 m away, 0.1 s after
the start. Wall time, the best of three, compilation not included.

Environments. OTHER_PYTHON has crazyflow, which wants another release of JAX. Both take
4,096 lanes through steps in single precision on all cores, in turns, each three times a
turn; wall time and processor time of the best. jblast's is one of 10 ms with position
hold, two blasts in an episode, observation, reward and autoreset
(`benchmark_environments`), 200 of them compiled as one program. crazyflow's is
`ReachPosEnv.step` as it comes, one call each, its actions sampled beforehand: at 500 Hz
a step of 2 ms, and at 100 Hz one of 10 ms in five.
"""

import argparse
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from calibration import run_part

# pyright: reportMissingImports=false
# The other simulators live in environments of their own.


REPEATS = 3
BLOCK = 100
"""Steps that crazyflow takes at a call, and RotorPy in a measurement."""


class Rate(NamedTuple):
    """One simulator as measured: what flew, how many, at which step, how fast."""

    simulator: str
    what: str
    vehicles: int
    step_s: float
    steps_per_s: float


# pyright: reportMissingImports=false
# The other simulator lives in an environment of its own.


ROUNDS, LANES, STEPS = 2, 4096, 200
RATES_HZ = (500, 100)
AGAIN = ("-m", "calibration.other_simulators")
ROOT = str(Path(__file__).parents[1])


def timed(call: Callable[[], object], steps: int) -> float:
    """Return steps a second, the best of some calls after a first."""
    call()
    best = float("inf")
    for _ in range(REPEATS):
        begin = time.perf_counter()
        call()
        best = min(best, time.perf_counter() - begin)
    return steps / best


def rotorpy_rates() -> Iterator[Rate]:
    """Measure RotorPy, one by one and batched."""
    import numpy as np
    from rotorpy.vehicles.crazyflie_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    one, step = Multirotor(quad_params), 1 / 100
    speeds = {"cmd_motor_speeds": np.full(4, 1788.53)}

    def alone():
        state = dict(one.initial_state)
        for _ in range(BLOCK):
            state = one.step(state, speeds, step)

    yield Rate("RotorPy", "rotor speeds, RK45", 1, step, timed(alone, BLOCK))
    if importlib.util.find_spec("torchdiffeq") is None:
        return
    import torch
    from rotorpy.controllers.quadrotor_control import BatchedSE3Control
    from rotorpy.vehicles.multirotor import BatchedMultirotor, BatchedMultirotorParams

    count, device = 2000, torch.device("cpu")
    parameters = BatchedMultirotorParams([quad_params] * count, count, device)
    hold = BatchedSE3Control(parameters, count, device)

    def many(row: list[float]) -> torch.Tensor:
        return torch.tensor(row, device=device).repeat(count, 1).double()

    still, hover = many([0.0] * 3), many([1788.53] * 4)
    start = {"x": still, "v": still, "q": many([0.0, 0.0, 0.0, 1.0]), "w": still}
    start |= {"wind": still, "rotor_speeds": hover}
    target = {name: still for name in ("x", "x_dot", "x_ddot", "x_dddot")}
    target |= {"yaw": still[:, 0], "yaw_dot": still[:, 0]}
    given = {"cmd_motor_speeds": hover}
    for what, integrator, held in (
        ("rotor speeds, dopri5", "dopri5", False),
        ("rotor speeds, rk4", "rk4", False),
        ("hold, rk4", "rk4", True),
    ):
        fleet = BatchedMultirotor(
            parameters, count, start, device, integrator=integrator
        )

        def batch(fleet=fleet, held=held):
            state = {name: part.clone() for name, part in start.items()}
            for n in range(BLOCK):
                asked = hold.update(n * step, state, target) if held else given
                state = fleet.step(state, asked, step)

        yield Rate("RotorPy", what, count, step, timed(batch, BLOCK * count))


def crazyflow_rates() -> Iterator[Rate]:
    """Measure crazyflow."""
    import jax
    import numpy as np
    from crazyflow.control import Control
    from crazyflow.sim import Sim
    from crazyflow.sim.integration import Integrator

    for what, control, integrator, count in (
        ("rotor speeds, Euler", Control.rotor_vel, Integrator.euler, 1024),
        ("rotor speeds, Euler", Control.rotor_vel, Integrator.euler, 16384),
        ("rotor speeds, RK4", Control.rotor_vel, Integrator.rk4, 1024),
        ("hold, Euler", Control.state, Integrator.euler, 1024),
        ("hold, Euler", Control.state, Integrator.euler, 16384),
    ):
        fleet = Sim(n_worlds=count, control=control, integrator=integrator)
        asked = np.zeros((count, 1, 16 if control == Control.state else 4))
        if control == Control.state:
            asked[..., 2], asked[..., 12] = 0.5, 1.0  # 0.5 m up, level
            fleet.state_control(asked)
        else:
            fleet.rotor_vel_control(asked + 15000.0)  # turns a minute

        def batch(fleet=fleet):
            fleet.reset()
            fleet.step(BLOCK)
            jax.block_until_ready(fleet.data)

        rate = timed(batch, BLOCK * count)
        yield Rate("crazyflow", what, count, 1 / fleet.freq, rate)


def jblast_rates() -> Iterator[Rate]:
    """Measure jblast."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_num_cpu_devices", os.cpu_count())
    jax.config.update("jax_enable_x64", True)

    from jblast.scene import Charge, Scene
    from jblast.vehicle import (
        PositionHold,
        State,
        blast_load,
        named,
        named_gains,
        simulate as fly,
    )

    vehicle, count, duration = named("crazyflie"), 16384, 0.2
    hold = PositionHold([0.0, 0.0, 5.0], named_gains("crazyflie"))
    blast = blast_load(
        Scene(
            charge=Charge(
                mass_kg=1.0, position_m=(5.0, 0.0, 5.0), time_s=0.1, burst="surface"
            )
        )
    )
    for what, dtype, integrator, step, held, loads in (
        ("rotor speeds, RK4, float64", "float64", "rk4", 5e-4, False, ()),
        ("rotor speeds, RK4", "float32", "rk4", 5e-4, False, ()),
        ("rotor speeds, RK4", "float32", "rk4", 1e-2, False, ()),
        ("rotor speeds, Euler", "float32", "euler", 2e-3, False, ()),
        ("hold, Euler", "float32", "euler", 2e-3, True, ()),
        ("hold, RK4", "float32", "rk4", 5e-4, True, ()),
        ("hold, RK4", "float32", "rk4", 2e-3, True, ()),
        ("hold, blast, RK4", "float32", "rk4", 5e-4, True, (blast,)),
        ("hold, blast, RK4", "float32", "rk4", 2e-3, True, (blast,)),
    ):
        rest = [[0.0, 0.0, 5.0], [0.0] * 3, [0.0, 0.0, 0.0, 1.0], [0.0] * 3]
        parts = [*rest, [1788.53] * 4]
        start = State(*(jnp.tile(jnp.asarray(p, dtype), (count, 1)) for p in parts))

        def batch(start=start, step=step, held=held, loads=loads, method=integrator):
            flown = fly(
                vehicle,
                start,
                duration_s=duration,
                step_s=step,
                integrator=method,
                control=hold if held else None,
                loads=loads,
                store_every=round(duration / step),
            )
            jax.block_until_ready(flown)

        steps = round(duration / step) * count
        yield Rate("jblast", what, count, step, timed(batch, steps))


RATES = {
    "rotorpy": rotorpy_rates,
    "crazyflow": crazyflow_rates,
    "jblast": jblast_rates,
}


def measured() -> list[Rate]:
    """Measure what is installed: jblast, where JAX and Equinox are."""
    found = []
    for name, rates in RATES.items():
        needs = {"jblast": ("jax", "equinox")}.get(name, (name,))
        if all(importlib.util.find_spec(one) for one in needs):
            found += rates()
    return found


def main() -> None:
    """Measure in every environment, and print one table."""
    parser = argparse.ArgumentParser(description="Seconds of flight a second.")
    parser.add_argument("python", nargs="*", help="other interpreters to measure with")
    parser.add_argument("--rows", action="store_true", help="print JSON")
    asked = parser.parse_args()
    busy = os.getloadavg()[0]
    rows = []
    for python in asked.python:
        command = [python, *AGAIN, "--rows"]
        answer = subprocess.run(command, check=True, capture_output=True, text=True)
        rows += [Rate(*row) for row in json.loads(answer.stdout.splitlines()[-1])]
    rows += measured()
    if asked.rows:
        print(json.dumps(rows))
        return
    if not rows:
        sys.exit("none of rotorpy, crazyflow and jblast's own needs is installed")
    print(
        f"Seconds of flight a second: {os.cpu_count()} cores, other load before "
        f"{busy:.1f}\n\n{'':42}{'vehicles':>8}{'step, ms':>10}{'steps/s':>10}"
        f"{'flight s/s':>12}"
    )
    for row in rows:
        print(
            f"{row.simulator:10}{row.what:32}{row.vehicles:8,}{1e3 * row.step_s:10g}"
            f"{row.steps_per_s:10.2g}{row.steps_per_s * row.step_s:12,.0f}"
        )


def crazyflow_environments() -> dict[str, tuple[float, float]]:
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


def jblast_environments() -> dict[str, tuple[float, float]]:
    """Return jblast's."""
    from jblast.cli.jax_start import start_jax

    start_jax(all_cores=True)
    import jax

    from calibration.benchmark_environments import begun, rollout
    from jblast.environments import environment_params
    from jblast.environments.lanes import CHUNK_LANES

    jax.config.update("jax_enable_x64", False)
    params = environment_params("Hover", command="hold")
    devices = len(jax.devices())
    states = begun(params, LANES)
    program = rollout(CHUNK_LANES, devices).lower(states, params).compile()

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


def environments() -> None:
    """Measure environment steps in turns, and print the table."""
    other = sys.argv[-1]
    if "--only" in sys.argv:
        rates = jblast_environments() if other == "jblast" else crazyflow_environments()
        sys.stdout.write(json.dumps(rates) + "\n")
        return
    best: dict[str, list[float]] = {}
    for _ in range(ROUNDS):
        for python, which in ((sys.executable, "jblast"), (other, "crazyflow")):
            command = [python, *AGAIN, "environments", "--only", which]
            # crazyflow's physics leaves a log where it runs
            with tempfile.TemporaryDirectory() as folder:
                said = subprocess.run(
                    command,
                    check=True,
                    capture_output=True,
                    text=True,
                    cwd=folder,
                    env=os.environ | {"PYTHONPATH": ROOT},
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
    print("\n".join(lines))


if __name__ == "__main__":
    run_part({"flights": main, "environments": environments})
