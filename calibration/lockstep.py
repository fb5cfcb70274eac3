"""Ten minutes in lockstep with a mock autopilot: no turn lost, the path as without.

An Iris holds its place by HIL_STATE_QUATERNION, over loopback, through three blasts;
the same hold within `vehicle.simulate`, on the same rounded numbers, flies beside it.

    python -m calibration.lockstep [SECONDS] > calibration/results/lockstep.txt
"""

import sys
import threading
import time

import numpy as np

from jblast.cli.jax_start import start_jax

SECONDS = 600.0
TIMES_S = (30.0, 200.0, 400.0)


def main(seconds: float) -> str:
    """Fly both, and return what is kept."""
    start_jax()
    from jblast.autopilot.mavlink.address import read_address
    from jblast.autopilot.mavlink.link import Link
    from jblast.autopilot.simulator.from_scene import turns_of
    from jblast.autopilot.simulator.lockstep import Lockstep, fly_lockstep
    from jblast.autopilot.simulator.mock import RoundedHold, fly_mock
    from jblast.autopilot.simulator.rotors import rotors_of
    from jblast.autopilot.simulator.stepping import PERIOD_S, programs
    from jblast.scene import Charge, Scene, VehicleSpec
    from jblast.vehicle import hold_of, simulate, vehicle_of

    spec = VehicleSpec("iris", position=np.array([8.0, 0.0, 10.0]))
    charges = [
        Charge(10.0, position_m=(0.0, 0.0, 0.0), time_s=t, name=f"at {t:g} s")
        for t in TIMES_S
    ]
    scene = Scene(charges[0], others=tuple(charges[1:]), vehicle=spec)
    turns, vehicle = turns_of(scene, spec, None, 0), vehicle_of(spec)
    rotors, hold = rotors_of(vehicle), hold_of(spec, integral=True)
    made = programs(turns)
    mock = RoundedHold(hold.ready(vehicle), turns.origin, rotors.of_motor)
    link = Link(read_address("tcp:127.0.0.1:0", "mavlink", 0), "mavlink")
    count = round(seconds / PERIOD_S)
    where = (link.address.host, link.address.port)
    other = threading.Thread(
        target=fly_mock, args=(where, mock, vehicle, count), daemon=True
    )
    other.start()
    while not link.accept(1.0):
        pass
    begun = time.perf_counter()
    flight = fly_lockstep(made, link, rotors, flight=Lockstep(), seconds=seconds)
    took = time.perf_counter() - begun
    link.close()
    other.join()
    alone = simulate(
        vehicle,
        turns.flight.state,
        duration_s=seconds,
        step_s=PERIOD_S,
        control=RoundedHold(hold, turns.origin, rotors.of_motor),
        wind=turns.flight.wind,
        loads=turns.flight.loads,
        ground_up_m=0.0,
    )
    path = np.array([row.state[:3] for row in flight.rows])
    apart = np.abs(path - np.asarray(alone.position_m)).max()
    thrown = np.linalg.norm(path - path[0], axis=1).max()
    rows = [
        ("flight [s]", f"{flight.seconds:g}"),
        ("turns told", f"{flight.turns}"),
        ("turns flown", f"{flight.flown}"),
        ("answers late", f"{flight.late}"),
        ("messages lost", f"{link.receiver.lost}"),
        ("messages damaged", f"{link.receiver.damaged}"),
        ("ended", flight.ended),
        ("greatest distance from its place [m]", f"{thrown:.3g}"),
        ("path, from that without a network [m]", f"{apart:.2g}"),
        ("wall clock, beside other work [s]", f"{took:.0f}"),
    ]
    return "\n".join(f"{name:<40}{value}" for name, value in rows) + "\n"


if __name__ == "__main__":
    text = main(float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS)
    sys.stdout.write(text)
