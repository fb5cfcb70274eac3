# pyright: reportMissingImports=false
# The other simulators live in environments of their own.
"""How many seconds of flight a second: jblast beside RotorPy and crazyflow.

    python -m calibration.flight_simulators OTHER_PYTHON... \
        > calibration/results/flight_simulators.txt

Each interpreter measures the simulators that are installed in its environment, one
after another; jblast's and crazyflow's want different releases of JAX. RotorPy's
batched vehicles want torch, torchdiffeq and roma beside it.

Crazyflies fly from hover, all cores, each simulator at its own default step and in its
own precision, and jblast at RotorPy's and crazyflow's too. "rotor speeds": constant
ones; "hold": a position hold, asked at every step but crazyflow's, asked 100 times a
second for place and 500 for attitude. crazyflow has no wind, and RotorPy's stands still
within a step; jblast's is still air, or a blast of 1 kg of TNT 5 m away, 0.1 s after
the start. Wall time, the best of three, compilation not included.
"""

import argparse
import importlib.util
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

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
        command = [python, "-m", "calibration.flight_simulators", "--rows"]
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


if __name__ == "__main__":
    main()
