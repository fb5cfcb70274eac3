"""Honest logs of sixty kilograms, by Kinney and Graham's laws, which no check uses."""

from dataclasses import replace
from functools import cache

import numpy as np

from jblast.observations import Observations
from jblast.scene import default_scene
from jblast.sensors.calculator import Rows, by_law

MASS = 60.0
PLACES = np.array(
    [
        [60.0, 10.0, 0.0],
        [-20.0, 95.0, 0.0],
        [-130.0, -40.0, 0.0],
        [40.0, -180.0, 0.0],
        [210.0, 120.0, 0.0],
    ]
)
PEAK, ARRIVAL, IMPULSE = (
    "peak_overpressure_pa",
    "air_arrival_s",
    "positive_impulse_pa_s",
)


@cache
def _told() -> dict[str, np.ndarray]:
    scene = default_scene().scene
    scene = replace(scene, charges=(replace(scene.charge, burst="surface"),))
    distance = np.linalg.norm(PLACES, axis=1)
    rows = Rows(scene, distance, np.full(len(distance), MASS))
    names = (PEAK, ARRIVAL, IMPULSE)
    return {name: by_law(rows, name)["kinney_graham"].value for name in names}


def log_of(
    *quantities: str, shift: tuple[float, float] = (0.0, 0.0), since: float = 0.0
) -> Observations:
    """Make a log of five sensors: shifted with its charge, and its clock set."""
    rows = [(i, q) for q in quantities for i in range(len(PLACES))]
    n = len(rows)
    value = np.array([_told()[q][i] + since * (q == ARRIVAL) for i, q in rows])
    sigma = np.where([q == ARRIVAL for _, q in rows], 1e-3, 0.05 * value)
    return Observations(
        sensor=tuple(f"s{i}" for i, _ in rows),
        quantity=tuple(q for _, q in rows),
        value=value,
        sigma=sigma,
        position=np.array([PLACES[i] + [*shift, 0.0] for i, _ in rows]),
        slant_range=np.full(n, np.nan),
        time=np.full(n, np.nan),
        path=("",) * n,
        shot=("",) * n,
        clock=("",) * n,
        line=tuple(range(2, n + 2)),
        source="log.csv",
    )


def with_value(log: Observations, row: int, factor: float) -> Observations:
    """Multiply one value, and its sigma."""
    value, sigma = log.value.copy(), log.sigma.copy()
    value[row] *= factor
    sigma[row] *= factor
    return replace(log, value=value, sigma=sigma)
