"""Ten minutes in lockstep with a mock autopilot: no turn lost, the path as without.

An Iris holds its place by HIL_STATE_QUATERNION, over loopback, through three blasts. It
flies once more by the same hold in this process, on messages that no network carries;
and within `vehicle.simulate`, another program, on numbers that are rounded alike: there
the last bit of a place decides in the end which whole number it is rounded to, a
centimetre, and the two part.

    python -m calibration.lockstep [SECONDS] > calibration/results/lockstep.txt
"""

import sys
import threading
import time
from typing import TYPE_CHECKING

import numpy as np

from jblast.cli.jax_start import start_jax

if TYPE_CHECKING:
    from jblast.autopilot.mavlink import Link
    from tests.tools.mock_autopilot import Mock

SECONDS = 600.0
TIMES_S = (30.0, 200.0, 400.0)


def main(seconds: float) -> str:
    """Fly both, and return what is kept."""
    start_jax()
    from jblast.autopilot.lockstep import (
        PERIOD_S,
        Lockstep,
        fly_lockstep,
        programs,
        rotors_of,
        turns_of,
    )
    from jblast.autopilot.mavlink import Link, read_address
    from jblast.scene import Charge, Scene, VehicleSpec
    from jblast.vehicle import hold_of, simulate, vehicle_of
    from tests.tools.mock_autopilot import Mock, RoundedHold, fly_mock

    spec = VehicleSpec("iris", position=np.array([8.0, 0.0, 10.0]))
    charges = [
        Charge(10.0, position_m=(0.0, 0.0, 0.0), time_s=t, name=f"at {t:g} s")
        for t in TIMES_S
    ]
    scene = Scene(charges[0], others=tuple(charges[1:]), vehicle=spec)
    turns, vehicle = turns_of(scene, spec, None, 0), vehicle_of(spec)
    rotors, hold = rotors_of(vehicle), hold_of(spec, integral=True)
    made = programs(turns)
    rounded = RoundedHold(hold.ready(vehicle), turns.origin, rotors.of_motor)
    link = Link(read_address("tcp:127.0.0.1:0", "mavlink", 0), "mavlink")
    count = round(seconds / PERIOD_S)
    where = (link.address.host, link.address.port)
    other = threading.Thread(
        target=fly_mock, args=(where, Mock(rounded, vehicle), count), daemon=True
    )
    other.start()
    while not link.accept(1.0):
        pass
    begun = time.perf_counter()
    flight = fly_lockstep(made, link, rotors, flight=Lockstep(), seconds=seconds)
    took = time.perf_counter() - begun
    link.close()
    other.join()
    beside = fly_lockstep(
        made,
        direct_link(Mock(rounded, vehicle)),
        rotors,
        flight=Lockstep(),
        seconds=seconds,
    )
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
    path, other_path = (
        np.array([row.state[:3] for row in each.rows]) for each in (flight, beside)
    )
    off = np.abs(path - np.asarray(alone.position_m)).max(axis=1)
    parts = np.flatnonzero(off > 1e-6)
    until = f"{parts[0] * PERIOD_S:g}" if parts.size else "all of it"
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
        (
            "path, from that in this process [m]",
            f"{np.abs(path - other_path).max():.2g}",
        ),
        ("path within 1e-6 m of simulate's until [s]", until),
        ("path, from simulate's at most [m]", f"{off.max():.2g}"),
        ("wall clock, beside other work [s]", f"{took:.0f}"),
    ]
    return "\n".join(f"{name:<44}{value}" for name, value in rows) + "\n"


def direct_link(mock: "Mock") -> "Link":
    """Return a link to an autopilot in this process: messages, and no network."""
    from jblast.autopilot.mavlink import Link, Message, Receiver

    class Direct(Link):
        def __init__(self) -> None:
            self.receiver, self._there, self._back = Receiver(), Receiver(), []

        def send(self, *frames: bytes) -> None:
            for message in self._there.feed(b"".join(frames)):
                said = mock.answer(message)
                if said is not None:
                    self._back.append(said)

        def receive(self, timeout_s: float) -> Message | None:
            if not self._back:
                return None
            return next(iter(self.receiver.feed(self._back.pop(0))))

    return Direct()


if __name__ == "__main__":
    text = main(float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS)
    sys.stdout.write(text)
