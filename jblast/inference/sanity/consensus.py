"""The blast that most rows of a shot agree on, and the rows that do not.

A search on a grid that counts who agrees, not a fit: one row off by a thousand would
carry a fit away (Fischler and Bolles, Comm. ACM 24, 381, 1981, who draw at random).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from jblast.inference.sanity.readings import Readings
from jblast.inference.sanity.scaled_laws import LARGEST, SMALLEST, ScaledLaws

MASSES = np.geomspace(SMALLEST, LARGEST, 160)
"""Charges that are tried [kg]: a factor 1.3 from one to the next."""
SIDE, FEW_MASSES, ROUNDS = 25, 28, 5
"""Places along each side of the grid, masses at each, and how often it is narrowed."""
MOST = 60
"""Rows that a place is looked for by; all are then held against it."""
AT_ONCE = 250_000
"""Readings times tries that are held in memory."""
SPREADS = 4.0
"""How far from the sensors a charge is looked for, in their median distances."""
SPEED = 340.0
"""Turns the spacing of a grid into seconds [m/s]."""


@dataclass(frozen=True)
class Agreement:
    """What a blast explains.

    Attributes:
        place: East, north, up [m].
        mass: Of the explosive [kg].
        residual: Of each reading, in its unit (ln, or seconds).
        offset: What its clock shows more than the time since the shot; 0 in ln.
        off: Which do not agree.
        checkable: Which can disagree at all: a clock's only reading cannot.
        unknowns: How many numbers were found from the rows.
    """

    place: Float[np.ndarray, "3"]
    mass: float
    residual: Float[np.ndarray, " n"]
    offset: Float[np.ndarray, " n"]
    off: Bool[np.ndarray, " n"]
    checkable: Bool[np.ndarray, " n"]
    unknowns: int

    def holds(self) -> bool:
        """Return whether so many agree that the rest is to be doubted."""
        agree = int((self.checkable & ~self.off).sum())
        return agree > self.unknowns and 2 * agree > int(self.checkable.sum())

    def all_agree(self) -> bool:
        """Return whether no row is off."""
        return not (self.checkable & self.off).any()

    def is_believable(self) -> bool:
        """Return whether as many rows agree as numbers were found, and two at least."""
        return int((self.checkable & ~self.off).sum()) >= max(self.unknowns, 2)

    def price(self) -> int:
        """Return what it costs to believe it: three numbers for a row that is off."""
        return 3 * int((self.checkable & self.off).sum()) + self.unknowns

    def share(self) -> float:
        """Return the share of rows that agree."""
        return float((self.checkable & ~self.off).sum() / max(self.checkable.sum(), 1))


def at_place(
    readings: Readings,
    laws: ScaledLaws,
    place: Float[np.ndarray, "3"],
    origin: float | None,
    masses: Float[np.ndarray, " mass"] = MASSES,
) -> Agreement:
    """Return what a charge at a known place explains, its mass searched.

    Args:
        readings: The rows.
        laws: Of a kilogram.
        place: East, north, up [m].
        origin: Time of the shot on the common clock [s]; None: it is found.
        masses: That are tried [kg].
    """
    places = np.broadcast_to(place, (len(masses), 3))
    return _best(readings, laws, places, masses, origin, 1)


def anywhere(readings: Readings, laws: ScaledLaws, height: float) -> Agreement:
    """Return what a charge explains whose place, time and mass are searched.

    Args:
        readings: The rows.
        laws: Of a kilogram.
        height: Of the charge [m].
    """
    few = _thinned(readings)
    at = few.position[~np.isnan(few.position).any(axis=1)]
    centre = np.median(at, axis=0)
    spread = float(np.median(np.linalg.norm(at[:, :2] - centre[:2], axis=1)))
    half = SPREADS * max(spread, 1.0)
    log_mass, log_half = np.log(SMALLEST * LARGEST) / 2, np.log(LARGEST / SMALLEST) / 2
    middle = np.array([centre[0], centre[1], log_mass])
    reach = np.array([half, half, log_half])
    counts = np.array([SIDE, SIDE, FEW_MASSES])
    for _ in range(ROUNDS):
        axes = [
            m + r * np.linspace(-1, 1, n)
            for m, r, n in zip(middle, reach, counts, strict=True)
        ]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        places = np.column_stack([grid[:, :2], np.full(len(grid), height)])
        spacing = 2 * reach[0] / (counts[0] - 1)
        _, cost = _misfit(few, laws, places, np.exp(grid[:, 2]), None, spacing)
        middle = grid[np.argmin(cost)]
        reach, counts = reach / 4, np.array([13, 13, 13])
    place = np.array([middle[0], middle[1], height])
    return _best(readings, laws, place[None], np.exp(middle[2:3]), None, 3)


def _best(
    readings: Readings,
    laws: ScaledLaws,
    places: Float[np.ndarray, "try 3"],
    masses: Float[np.ndarray, " try"],
    origin: float | None,
    unknowns: int,
) -> Agreement:
    """Return the agreement of the best of some tries."""
    score, cost = _misfit(readings, laws, places, masses, origin)
    best = int(np.argmin(cost))
    place, mass = places[best], float(masses[best])
    one = slice(best, best + 1)
    residual, offset, _ = _residuals(readings, laws, places[one], masses[one], origin)
    free = [c for c in range(readings.clock.max(initial=-1) + 1) if c or origin is None]
    counts = {c: int((readings.clock == c).sum()) for c in free}
    lonely = np.isin(readings.clock, [c for c in free if counts[c] == 1])
    return Agreement(
        place=place,
        mass=mass,
        residual=residual[0],
        offset=offset[0],
        off=np.abs(score[best]) > 1.0,
        checkable=~lonely,
        unknowns=unknowns + sum(counts[c] > 1 for c in free),
    )


def _misfit(
    readings: Readings,
    laws: ScaledLaws,
    places: Float[np.ndarray, "try 3"],
    masses: Float[np.ndarray, " try"],
    origin: float | None,
    spacing: float = 0.0,
) -> tuple[Float[np.ndarray, "try n"], Float[np.ndarray, " try"]]:
    """Return residuals over what is allowed, and a cost that counts who is off."""
    scores, costs = [], []
    step = max(1, AT_ONCE // max(len(readings.row), 1))
    for start in range(0, len(masses), step):
        part = slice(start, start + step)
        residual, _, allowed = _residuals(
            readings, laws, places[part], masses[part], origin
        )
        if spacing:
            distance = readings.distances(places[part])
            blur = 2 * spacing / np.maximum(distance, spacing)
            allowed = allowed + np.where(readings.timed, spacing / SPEED, blur)
        score = residual / allowed
        scores.append(score)
        costs.append(np.minimum(score**2, 1.0).sum(axis=1))
    return np.concatenate(scores), np.concatenate(costs)


def _residuals(
    readings: Readings,
    laws: ScaledLaws,
    places: Float[np.ndarray, "try 3"],
    masses: Float[np.ndarray, " try"],
    origin: float | None,
) -> tuple[
    Float[np.ndarray, "try n"], Float[np.ndarray, "try n"], Float[np.ndarray, "try n"]
]:
    """Return residuals, what clocks show (taken off them), and what is allowed."""
    distance = readings.distances(places)
    travelled = readings.travelled(laws, distance, masses)
    residual = readings.value - travelled
    offset = np.zeros_like(residual)
    for clock in range(readings.clock.max(initial=-1) + 1):
        here = readings.clock == clock
        if not here.any():
            continue
        if clock == 0 and origin is not None:
            offset[:, here] = origin
        else:
            offset[:, here] = np.median(residual[:, here], axis=1, keepdims=True)
    residual = residual - offset
    residual = np.where(readings.bound, np.maximum(residual, 0.0), residual)
    allowed = readings.allowed(np.where(readings.timed, travelled, 0.0), distance)
    return residual, offset, allowed


def _thinned(readings: Readings) -> Readings:
    """Return evenly picked rows, no more than `MOST`."""
    n = len(readings.row)
    if n <= MOST:
        return readings
    return readings.only(np.unique(np.linspace(0, n - 1, MOST).astype(int)))
