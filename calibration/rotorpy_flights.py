# RotorPy lives in an environment of its own.
"""Flights of RotorPy 3.0.0 (MIT), which those of jblast are held against.

    python -m calibration.rotorpy_flights > calibration/data/rotorpy_flights.csv

An environment with rotorpy, SciPy and jaxtyping is enough. The rates are RotorPy's own,
`Multirotor._s_dot_fn`; its state holds the wind, which is set at every call. SciPy's
DOP853 integrates them to 1e-12 and stops at every command and at every edge of a gust,
both seen from inside. Rotor commands jump every 2 ms; every fiftieth is 1.6 times the
hover speed, more than a Crazyflie's motors give.
"""

import sys
from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.integrate import solve_ivp

DURATION = 2.5
HELD = 2e-3
EVERY = 0.25
HOVER = {"crazyflie": 1788.0, "hummingbird": 469.0}
"""About the rotor speed of hover [rad/s]."""
LEVEL = {
    "x": [0.0, 0.0, 5.0],
    "v": [0.0, 0.0, 0.0],
    "q": [0.0, 0.0, 0.0, 1.0],
    "w": [0.0, 0.0, 0.0],
}
TUMBLING = {
    "x": [0.0, 0.0, 5.0],
    "v": [1.0, -2.0, 0.5],
    "q": [0.4, -0.2, 0.4, 0.8],
    "w": [3.0, -2.0, 4.0],
}


class Gust(NamedTuple):
    """A gust: its wind at the onset [m/s], when that is, and how long it lasts [s]."""

    kind: str = "calm"
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    start: float = 0.0
    duration: float = 1.0

    def at(self, time: float) -> Float[np.ndarray, "3"]:
        """Velocity of the air at a time [m/s]."""
        phase = (time - self.start) / self.duration
        shape = {
            "calm": 0.0,
            "step": 1.0,
            "n-wave": 1.0 - 2.0 * phase if phase <= 1.0 else 0.0,
            "friedlander": (1.0 - phase) * np.exp(-phase),
        }[self.kind]
        return np.array(self.velocity) * shape * (phase >= 0.0)


STEP = Gust("step", (4.0, -3.0, 1.0), 0.5)
FLIGHTS = {
    "calm": (LEVEL, Gust()),
    "step": (LEVEL, STEP),
    "n-wave": (LEVEL, Gust("n-wave", (20.0, 10.0, -5.0), 0.5, 0.02)),
    "friedlander": (LEVEL, Gust("friedlander", (25.0, 0.0, 5.0), 0.5, 0.01)),
    "tumbling": (TUMBLING, STEP),
}
"""Start and gust of each flight."""

Rates = Callable[[Float[np.ndarray, " part"], Float[np.ndarray, "4"]], np.ndarray]


def commands(hover: float) -> Float[np.ndarray, "row 4"]:
    """Rotor speeds asked for, each held for `HELD` [rad/s].

    Args:
        hover: About the speed of hover [rad/s].
    """
    row, rotor = np.arange(round(DURATION / HELD))[:, None], np.arange(4)
    jumps = 0.2 * ((37 * row + 11 * rotor) % 64 / 64 - 0.5)
    swings = 0.02 * np.sin(2 * np.pi * (0.8 + 0.3 * rotor) * HELD * row + rotor)
    spikes = 0.6 * ((7 * row + 13 * rotor) % 50 == 0)
    return hover * (0.99 + jumps + swings + spikes)


def flown(
    rates: Rates,
    start: Float[np.ndarray, " part"],
    asked: Float[np.ndarray, "row 4"],
    gust: Gust,
) -> Float[np.ndarray, "row part"]:
    """Integrate a flight; a row at the start and every `EVERY` seconds.

    Args:
        rates: Of RotorPy's state, from it and the rotor speeds asked for.
        start: That state: position, velocity, quaternion, body rate, wind, rotor speed.
        asked: Rotor speeds, a row for each `HELD`.
        gust: Of the air.
    """
    state, rows = start, [start]
    jumps = [gust.start, gust.start + gust.duration]
    for n, command in enumerate(asked):
        begin, end = n * HELD, (n + 1) * HELD
        inner = [t for t in jumps if begin + 1e-9 < t < end - 1e-9]
        for a, b in pairwise([begin, *inner, end]):

            def moving(time, state, a=a + 1e-12, b=b - 1e-12, command=command):
                state[13:16] = gust.at(min(max(time, a), b))
                return rates(state, command)

            answer = solve_ivp(
                moving, (a, b), state, method="DOP853", rtol=1e-12, atol=1e-13
            )
            state = answer.y[:, -1]
        if (n + 1) % round(EVERY / HELD) == 0:
            rows.append(state)
    return np.array(rows)


def main() -> None:
    """Fly all of them, and print the table."""
    try:
        from rotorpy.vehicles import crazyflie_params, hummingbird_params  # type: ignore
        from rotorpy.vehicles.multirotor import Multirotor  # type: ignore
    except ImportError:
        sys.exit("rotorpy is not installed: pip install rotorpy==3.0.0")
    parameters = {"crazyflie": crazyflie_params, "hummingbird": hummingbird_params}
    print(
        "# Flights of RotorPy 3.0.0 (MIT, Folk, Paulos and Kumar 2023), its equations\n"
        "# integrated to 1e-12 by calibration/rotorpy_flights.py, which tells starts,\n"
        "# gusts and commands. Quaternion body to world, scalar last.\n"
        "vehicle,flight,time_s,east_m,north_m,up_m,q_i,q_j,q_k,q_w"
    )
    for name, hover in HOVER.items():
        quadrotor = Multirotor(parameters[name].quad_params)
        low, high = quadrotor.rotor_speed_min, quadrotor.rotor_speed_max

        def rates(state, command, quadrotor=quadrotor, low=low, high=high):
            return quadrotor._s_dot_fn(0.0, state, np.clip(command, low, high))

        for flight, (start, gust) in FLIGHTS.items():
            parts = [*start.values(), [0.0] * 3, [hover] * 4]
            rows = flown(rates, np.concatenate(parts), commands(hover), gust)
            for n, row in enumerate(rows):
                place = np.concatenate([row[:3], row[6:10]])
                numbers = ",".join(f"{x:.13g}" for x in place)
                print(f"{name},{flight},{n * EVERY:g},{numbers}")


if __name__ == "__main__":
    main()
