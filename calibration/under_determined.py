"""Do logs that leave something open end with exit code 4 and a sentence?

    python -m calibration.under_determined [LOGS]

Random logs of two kinds are fitted: fewer readings than unknowns, and readings alike.
"""

import sys
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from jblast.cli.jax_start import start_jax
from jblast.inference import Fit, fit
from jblast.observations import Observations, observed
from jblast.report.fit_report import not_identified
from jblast.scene import UncertainScene, default_scene, freed, with_laws

PLACE = ("charge_east_m", "charge_north_m")
TIMED_PLACE = ("origin_time_s", *PLACE)
SPEED = 340.0


class Kind(NamedTuple):
    """Quantities, by how many sensors each, and what is free beside the mass."""

    quantities: tuple[str, ...]
    sensors: int
    free: tuple[str, ...]
    repeats: int = 1
    law: tuple[tuple[str, str], ...] = ()

    def __str__(self) -> str:
        what = ", ".join(self.quantities) + f" at {self.sensors}"
        what += f" x {self.repeats}" if self.repeats > 1 else ""
        what += "".join(f" by {law}" for _, law in self.law)
        return what + "; free: " + ", ".join(("charge_mass_kg", *self.free))


ARRIVAL, PRESSURE = ("air_arrival_s",), ("peak_overpressure_pa",)
IMPULSE, BEARING = ("positive_impulse_pa_s",), ("bearing_rad",)
RADIUS = ("fireball_radius_m",)
KINDS = (
    Kind(ARRIVAL, 2, TIMED_PLACE, law=(("air_arrival_s", "kingery_bulmash"),)),
    Kind(PRESSURE, 2, PLACE, law=(("peak_overpressure_pa", "swisdak"),)),
    Kind(BEARING, 1, PLACE),
    Kind(RADIUS, 2, ("origin_time_s",)),
    Kind(ARRIVAL, 1, ("origin_time_s",)),
    Kind(ARRIVAL, 2, TIMED_PLACE),
    Kind(ARRIVAL, 3, TIMED_PLACE),
    Kind(PRESSURE, 1, PLACE),
    Kind(PRESSURE, 2, (*PLACE, "charge_up_m")),
    Kind(IMPULSE, 1, PLACE),
    Kind(IMPULSE, 2, PLACE),
    Kind(BEARING, 3, PLACE),
    Kind(RADIUS, 1, ("origin_time_s",)),
    Kind((*ARRIVAL, *PRESSURE, *IMPULSE), 1, TIMED_PLACE),
    Kind((*BEARING, *ARRIVAL), 1, TIMED_PLACE),
    # as many readings as unknowns, or more, yet all of one place
    Kind((*ARRIVAL, *PRESSURE), 1, TIMED_PLACE, repeats=3),
    Kind(PRESSURE, 1, PLACE, repeats=4),
    Kind(
        *(ARRIVAL, 3, (*TIMED_PLACE, "air_sound_speed_m_s")),
        law=(("air_arrival_s", "wu_hao"),),
    ),
)
SIGMA = {"air_arrival_s": 1e-3, "bearing_rad": 0.02}
SHARE = 0.05


def drawn(kind: Kind, rng: np.random.Generator) -> tuple[Observations, UncertainScene]:
    """Draw a log of a kind: its readings no more than plausible, its places any.

    Of four logs one has a charge at a sensor, one has sensors that stand together.
    """
    size = 10 ** rng.uniform(0.5, 3)
    places = rng.uniform(-size, size, (kind.sensors, 3)) * [1, 1, 0]
    charge = rng.uniform(-size, size, 3) * [1, 1, 0]
    case = rng.integers(4)
    if case == 1:
        charge = places[0].copy()
    if case == 2:
        places[:] = places[0]
    mass = 10 ** rng.uniform(-1, 4)
    rows = []
    for i, at in enumerate(places):
        away = charge - at
        r = max(float(np.linalg.norm(away)), 0.3)
        for quantity in kind.quantities:
            for repeat in range(kind.repeats):
                time = 1e-3 * (i + 1) * (repeat + 1) * rng.uniform(0.5, 2)
                value = {
                    "air_arrival_s": 3 + 0.8 * r / SPEED,
                    "peak_overpressure_pa": 1e6 * mass ** (2 / 3) / r**2,
                    "positive_impulse_pa_s": 300 * mass ** (2 / 3) / r,
                    "bearing_rad": float(np.arctan2(away[0], away[1]) % (2 * np.pi)),
                    "fireball_radius_m": 2 * mass ** (1 / 3) * (time / 1e-3) ** 0.4,
                }[quantity]
                sigma = SIGMA.get(quantity)
                error = rng.standard_t(4)
                if sigma is None:
                    sigma = SHARE * value
                    value *= np.exp(SHARE * error)
                else:
                    value += sigma * error
                seen = 3 + time if quantity == "fireball_radius_m" else np.nan
                rows.append((f"s{i}", quantity, value, sigma, at, seen))
    *row, position, time = zip(*rows, strict=True)
    log = observed(*row, position=np.array(position), time=np.array(time))
    asked = freed(with_laws(default_scene(), dict(kind.law)), list(kind.free))
    return log, asked


def logs(
    count: int, kinds: int, seed: int
) -> Iterator[tuple[Kind, tuple[Observations, UncertainScene]]]:
    """Draw so many logs of the first kinds, in turn."""
    rng = np.random.default_rng(seed)
    for i in range(count):
        kind = KINDS[i % kinds]
        yield kind, drawn(kind, rng)


def ended(made: tuple[Observations, UncertainScene]) -> Fit | Exception:
    """Fit a log; return what ended otherwise too."""
    try:
        return fit(*made)
    except Exception as error:  # what must not be is counted
        return error


def fault(found: Fit | Exception) -> str:
    """Say what is wrong with an end; "" if it is as it should be."""
    if isinstance(found, Exception):
        return f"{type(found).__name__}: {found}"
    answer = found.summary
    if found.exit_code != 4:
        return f"exit code {found.exit_code}"
    least = max(len(answer.free) - len(found.observations), 1)
    if len(answer.null_directions) < least:
        return f"{len(answer.null_directions)} null directions for {least}"
    return "" if not_identified(answer, answer.estimates) else "no sentence"


def main(count: int = 1000) -> None:
    """Fit logs of all kinds, and print which do not end as they should."""
    start_jax(quick=True)
    right = 0
    for i, (kind, made) in enumerate(logs(count, len(KINDS), 0), start=1):
        said = fault(ended(made))
        right += not said
        if said:
            print(f"{i}: {kind}: {said}", flush=True)
    print(f"{right} of {count} end with exit code 4 and a sentence")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
