"""The blast that most rows of a shot agree on, for checks of a log before a fit.

The rows of a shot are compared with blasts of any mass. By Hopkinson's scaling a charge
of mass $M$ at the distance $r$ has the pressures that 1 kg has at
$Z = r / M^{1/3}$, and times and impulses $M^{1/3}$ as large (Baker, Explosions in Air,
1973, ch. 3). So one table of 1 kg per quantity, over $Z$, serves all masses.

The mass, and where needed the position and the origin time, are searched on a grid. The
score is the number of rows that agree, not a sum of squares: one row off by a factor of
a thousand would dominate a fit (Fischler and Bolles, Comm. ACM 24, 381, 1981, who draw
at random).

Each row that disagrees with a blast has a price, as has each number that is found.
Position and time of the scene are used where it has them. The same blast with another
unit of all readings of a quantity replaces it if that is cheaper, with the price of the
mistake. Without a scene a fit assumes the origin and time 0, and a blast at another
time or position replaces this one if it is cheaper.

The tolerances are those of a check: a factor of three for pressures, impulses and
durations, a share of the travel time for arrivals. The result is no estimate.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from jblast.constants import PSI, STANDARD_SOUND_SPEED, TNT_SPECIFIC_ENERGY
from jblast.observations import Observations
from jblast.observations.check import doubt
from jblast.parameters import CHARGE_POSITION, CLOCK_OFFSET
from jblast.quantities import QUANTITIES
from jblast.results import Note
from jblast.scene import Charge, Scene, UncertainScene
from jblast.scene.uncertain import NO_SCENE
from jblast.sensors.calculator import Rows, by_law

MAX_MASS = 50e6 * 1e3 * 4.184e6 / TNT_SPECIFIC_ENERGY
"""Mass of TNT of the largest explosion made so far [kg]: 50 Mt, 30 October 1961
(Adamsky and Smirnov, Cold War International History Project Bulletin 4, 1994)."""
MIN_MASS = 1e-6
"""A milligram [kg]: what microscale experiments detonate (declared)."""
MASSES = np.geomspace(MIN_MASS, MAX_MASS, 160)
"""Masses of the search at a known position [kg]. Their ratio of 1.3 changes times and
impulses by some 9 %, pressures by 30 % at most: far less than `FACTOR`."""
GRIDS = ((25, 25, 28), *[(13, 13, 13)] * 4)
"""Points along east, north and ln mass of each grid of the search for a position. Each
grid is a quarter as wide as the one before: the last is 1/256 as wide as the first."""
SEARCH_ROWS = 60
"""Largest number of rows of a search, which takes as long as it has rows. All rows are
then compared with the result."""
SPREADS = 4.0
"""Half width of the searched square about the sensors, in their median distances."""
SIGMAS = 5.0
"""Residual in sigmas that no error of reading explains: 1 in 1.7 million by chance."""
FACTOR = 3.0
"""Tolerance of a pressure, an impulse or a duration: a reflection doubles it, and
a law, a burst in the air, or ground between may halve it."""
TRAVEL_TIME_TOLERANCE = 0.07
"""Relative tolerance of a travel time: wind, and air that differs from the scene's."""
STRATOSPHERE_RANGE, STRATOSPHERE_TOLERANCE = 20e3, 0.25
"""Distance beyond which sound may travel through the stratosphere [m], at 280 m/s and
less (Negraru et al., J. Geophys. Res. 115, D15110, 2010; read second-hand), and the
relative tolerance of travel times there."""
CLOCK_STEP = 1e-3
"""Tolerance of any arrival [s]: logs are often written in milliseconds."""
PRICE = 3
"""Penalty of a row that disagrees, or of a supposed mistake, in units of fitted
numbers. A blast with a free position, mass and time replaces a fixed one if it explains
two rows more."""
NO_CLOCK = -1  # of readings without a clock, below all numbers of clocks
LAWS = {
    "air_arrival_s": "shock_kinematics",
    "peak_overpressure_pa": "shock_kinematics",
    "positive_impulse_pa_s": "shock_kinematics",
    "positive_duration_s": "shock_kinematics",
    "reflected_pressure_pa": "kingery_bulmash",
    "reflected_impulse_pa_s": "kingery_bulmash",
}
"""Laws that are defined from the charge to where it is inaudible. Those of reflections
continue as power laws."""
WITH_MASS = {
    "air_arrival_s",
    "positive_impulse_pa_s",
    "positive_duration_s",
    "reflected_impulse_pa_s",
}
"""Quantities that grow with the cube root of the mass at one scaled distance."""
SCALED_DISTANCES = np.geomspace(1e-3, 1e6, 901)
"""Scaled distances of the tables [m/kg^(1/3)]: 100 a decade."""
# Ratios of a wrong to the right value, by the mistake; the key is part of the warning.
_MILLI = {"a thousand times": 1e3, "a thousandth of": 1e-3}
_PSI = {
    "psi written as kPa": 1e3 / PSI,
    "kPa written as psi": PSI / 1e3,
    "psi written as Pa": 1 / PSI,
    "Pa written as psi": PSI,
}
_PRESSURE = {"mbar written as Pa": 1e-2, "Pa written as mbar": 1e2}
_BAR = {"bar written as Pa": 1e-5, "Pa written as bar": 1e5}
_TIME = {"minutes written as seconds": 1 / 60, "seconds written as minutes": 60.0}
FACTORS: Mapping[str, Mapping[str, float]] = {
    "pressure": {**_MILLI, **_PSI, **_PRESSURE, **_BAR},
    "impulse": {**_MILLI, **_PSI},
    "duration": {**_MILLI, **_TIME},
    "arrival": {**_MILLI, **_TIME},
    "flash": {},
}
"""Ratio of a value with the wrong unit to the right one, by kind of quantity."""


@dataclass(frozen=True)
class ScaledLaws:
    """Laws of 1 kg of an explosive in the air of a scene, over `SCALED_DISTANCES`.

    Attributes:
        log_value: ln of the value at each, by quantity.
        valid: True within the range of the law, by quantity.
    """

    log_value: Mapping[str, Float[np.ndarray, " z"]]
    valid: Mapping[str, Bool[np.ndarray, " z"]]

    def predicted(
        self,
        quantity: str,
        distance: Float[np.ndarray, "..."],
        mass: Float[np.ndarray, "..."],
    ) -> Float[np.ndarray, "..."]:
        """Return ln of a quantity at given distances from given masses."""
        third = np.log(mass) / 3
        log_z = np.log(np.maximum(distance, 1e-6)) - third
        value = np.interp(log_z, np.log(SCALED_DISTANCES), self.log_value[quantity])
        return value + third if quantity in WITH_MASS else value

    def by_mass(
        self, quantity: str, distance: float
    ) -> tuple[Float[np.ndarray, " z"], Float[np.ndarray, " z"]]:
        """Return ln of rising masses [kg], and ln of what the valid law gives."""
        valid = np.flatnonzero(self.valid[quantity])[::-1]
        third = np.log(distance / SCALED_DISTANCES[valid])
        value = self.log_value[quantity][valid]
        return 3 * third, value + third if quantity in WITH_MASS else value

    def fastest(self) -> float:
        """Return the largest mean speed [m/s] from the charge by a valid law."""
        _, log_time = self.by_mass("air_arrival_s", 1.0)
        return float(np.exp(-log_time.min()))


def scaled_laws(scene: Scene) -> ScaledLaws:
    """Tabulate the laws for 1 kg of a scene's explosive, in its air.

    A charge without a stated burst has the curves of a surface burst. Free-air curves
    are those of about half the mass, and no warning depends on a factor of two.
    """
    charge = replace(scene.charge, burst=scene.charge.burst or "surface")
    scene = replace(scene, charges=(charge,))
    rows = Rows(scene, SCALED_DISTANCES, np.ones_like(SCALED_DISTANCES))
    found = {quantity: by_law(rows, quantity)[name] for quantity, name in LAWS.items()}
    return ScaledLaws(
        log_value={quantity: np.log(one.value) for quantity, one in found.items()},
        valid={quantity: one.valid for quantity, one in found.items()},
    )


@dataclass(frozen=True)
class Readings:
    """Rows of one shot, on the scale of their errors.

    Attributes:
        row: Row number in the log.
        quantity: Quantity of each row.
        value: Seconds for readings of a clock, ln for all others.
        position: East, north, up of the sensor [m]; NaN where a range is given.
        slant_range: Distance from the charge [m]; NaN where a position is given.
        clock: Number of its clock, 0 for the common one; `NO_CLOCK` without one.
        error: `SIGMAS` times its sigma, same unit.
        bound: True for a lower bound.
    """

    row: Int[np.ndarray, " n"]
    quantity: Shaped[np.ndarray, " n"]
    value: Float[np.ndarray, " n"]
    position: Float[np.ndarray, "n 3"]
    slant_range: Float[np.ndarray, " n"]
    clock: Int[np.ndarray, " n"]
    error: Float[np.ndarray, " n"]
    bound: Bool[np.ndarray, " n"]

    @property
    def timed(self) -> Bool[np.ndarray, " n"]:
        """True for readings of a clock."""
        return self.clock >= 0

    def only(self, kept: Shaped[np.ndarray, " _"]) -> "Readings":
        """Return some of the readings, by number or by mask."""
        return Readings(**{f.name: getattr(self, f.name)[kept] for f in fields(self)})

    def rescaled(self, here: Bool[np.ndarray, " n"], factor: float) -> "Readings":
        """Return the readings with some of their values divided by a factor."""
        changed = np.where(self.timed, self.value / factor, self.value - np.log(factor))
        return replace(self, value=np.where(here, changed, self.value))

    def distances(
        self, places: Float[np.ndarray, "place 3"]
    ) -> Float[np.ndarray, "place n"]:
        """Return the distance of each sensor from a charge at given positions [m]."""
        apart = np.linalg.norm(self.position - places[:, None], axis=-1)
        return np.where(np.isnan(self.slant_range), apart, self.slant_range)

    def compared(
        self,
        laws: ScaledLaws,
        places: Float[np.ndarray, "place 3"],
        masses: Float[np.ndarray, " place"],
        origin: float | None = None,
        offset: Float[np.ndarray, "place n"] | None = None,
        spacing: float = 0.0,
    ) -> tuple[
        Float[np.ndarray, "place n"],
        Float[np.ndarray, "place n"],
        Float[np.ndarray, "place n"],
    ]:
        """Return residuals, their tolerance, and clock offsets, subtracted already.

        Args:
            laws: Laws of 1 kg.
            places: Positions of the charge [m].
            masses: Its mass at each [kg].
            origin: Time of the shot on the common clock [s]; None to estimate it.
            offset: Time of the shot on the clock of each reading [s], 0 for readings in
                ln; None to estimate it.
            spacing: Distance of these positions from each other [m].
        """
        distance = self.distances(places)
        predicted = np.zeros_like(distance)
        for quantity in set(self.quantity) - {"flash_time_s"}:
            here = self.quantity == quantity
            law = laws.predicted(quantity, distance[:, here], masses[:, None])
            predicted[:, here] = np.exp(law) if quantity == "air_arrival_s" else law
        residual = self.value - predicted
        if offset is None:
            offset = np.zeros_like(residual)
            for clock in set(self.clock[self.timed].tolist()):
                here = self.clock == clock
                # a median: wrong arrivals, fewer than half, do not shift it
                offset[:, here] = np.median(residual[:, here], axis=1, keepdims=True)
                if clock == 0 and origin is not None:
                    offset[:, here] = origin
        residual = residual - offset
        residual = np.where(self.bound, np.maximum(residual, 0.0), residual)
        share = np.where(
            distance > STRATOSPHERE_RANGE, STRATOSPHERE_TOLERANCE, TRAVEL_TIME_TOLERANCE
        )
        # the optimum may lie between grid points
        sound = spacing / STANDARD_SOUND_SPEED
        times = CLOCK_STEP + share * predicted + sound
        factors = np.log(FACTOR) + 2 * spacing / np.maximum(distance, spacing or 1.0)
        allowed = self.error + np.where(self.timed, times, factors)
        return residual, allowed, offset


@dataclass(frozen=True)
class Blast:
    """A blast, and the agreement of the rows of a shot with it.

    Attributes:
        readings: The rows, corrected where a mistake is supposed.
        place: East, north, up of the charge [m].
        mass: Mass of the explosive [kg].
        distance: Distance of each row from the charge [m]; NaN if its position is not
            given.
        origin: Time of the shot on the common clock [s]; None if it is not given.
        residual: Residual of each reading, in its unit (ln, or seconds).
        offset: Reading of its clock minus the time since the shot; 0 for readings in
            ln.
        off: True for readings that disagree, where they can: the only reading of a
            clock cannot.
        checkable: Number of readings that can disagree.
        unknowns: Number of parameters found from the rows.
        doubt: Mistake of the log that it supposes.
        price: Number of unknowns, plus `PRICE` for each row that disagrees and for a
            mistake in the readings.
    """

    readings: Readings
    place: Float[np.ndarray, "3"]
    mass: float
    distance: Float[np.ndarray, " n"]
    origin: float | None
    residual: Float[np.ndarray, " n"]
    offset: Float[np.ndarray, " n"]
    off: Bool[np.ndarray, " n"]
    checkable: int
    unknowns: int
    price: int
    doubt: Note | None = None

    @property
    def agree(self) -> int:
        """Number of rows that agree."""
        return self.checkable - int(self.off.sum())

    def holds(self) -> bool:
        """Return True if a majority agrees, so that the other rows are suspect."""
        return self.agree > self.unknowns and 2 * self.agree > self.checkable


def blast_of(
    readings: Readings,
    laws: ScaledLaws,
    charge: Charge,
    uncertain: UncertainScene,
    label: str,
) -> Blast:
    """Return the blast with which the rows of a shot are compared.

    Args:
        readings: The rows.
        laws: Laws of 1 kg.
        charge: Charge of the scene.
        uncertain: The scene.
        label: Suffix of the names of the charge's numbers.
    """
    free = set(uncertain.beliefs)
    origin = None if f"origin_time_s{label}" in free else float(charge.time_s)
    place = np.array([float(x) for x in charge.position_m])
    is_placed = free.isdisjoint(f"{name}{label}" for name in CHARGE_POSITION)
    if charge.range_m is not None:
        is_placed = f"charge_range_m{label}" not in free
        reach = float(charge.range_m) if is_placed else np.nan
        readings = replace(readings, slant_range=np.full(len(readings.row), reach))
    # where all rows have a range, the position has no effect
    if not is_placed and np.isnan(readings.slant_range).any():
        return replace(anywhere(readings, laws, place[2]), origin=origin)
    stated = at_place(readings, laws, place, origin)
    if not stated.off.any():
        return stated
    best = _cheapest(stated, _in_other_units(stated, laws))
    if best is stated and uncertain.source == NO_SCENE:
        first = (int(readings.row[0]),)
        later = at_place(readings, laws, place, None)
        elsewhere = anywhere(readings, laws, place[2])
        east, north, _ = elsewhere.place.tolist()
        there = doubt("not_at_the_origin", first, east_m=east, north_m=north)
        tried = [
            replace(later, doubt=doubt("not_at_time_0", first)),
            replace(elsewhere, doubt=there),
        ]
        best = _cheapest(stated, tried)
    return best


def _cheapest(stated: Blast, tried: list[Blast]) -> Blast:
    """Return the blast of the scene, or one that explains more for its price."""
    # at least as many rows agree as numbers were found, and two
    believable = [blast for blast in tried if blast.agree >= max(blast.unknowns, 2)]
    return min(
        [stated, *believable], key=lambda blast: (blast.price, not blast.holds())
    )


def _in_other_units(stated: Blast, laws: ScaledLaws) -> list[Blast]:
    """Return the blasts on which all rows agree with another unit of a quantity."""
    readings, tried = stated.readings, []
    quantities = set(readings.quantity.tolist()) - {"flash_time_s"}
    # of one quantity alone another mass, or position, explains any unit
    for quantity in sorted(quantities) if len(quantities) > 1 else ():
        here = readings.quantity == quantity
        rows = tuple(readings.row[here].tolist())
        for name, factor in FACTORS[QUANTITIES[quantity].kind].items():
            changed = readings.rescaled(here, factor)
            blast = at_place(changed, laws, stated.place, stated.origin)
            if len(rows) > 1 and not blast.off.any():
                note = doubt("units_of_a_quantity", rows, factor=factor, unit=name)
                tried.append(replace(blast, price=blast.price + PRICE, doubt=note))
    return tried


def at_place(
    readings: Readings,
    laws: ScaledLaws,
    place: Float[np.ndarray, "3"],
    origin: float | None,
) -> Blast:
    """Return the agreement with a charge at a known position, its mass searched.

    Args:
        readings: The rows.
        laws: Laws of 1 kg.
        place: East, north, up [m].
        origin: Time of the shot on the common clock [s]; None to estimate it.
    """
    places = np.broadcast_to(place, (len(MASSES), 3))
    best = _closest(_thinned(readings), laws, places, MASSES, origin)
    blast = _compared(readings, laws, place, float(MASSES[best]), origin, 1)
    return replace(blast, distance=readings.distances(place[None])[0])


def anywhere(readings: Readings, laws: ScaledLaws, height: float) -> Blast:
    """Return the agreement with a charge whose position, time and mass are searched.

    Without three positions there is nothing to search: no row can then disagree.

    Args:
        readings: The rows.
        laws: Laws of 1 kg.
        height: Height of the charge [m].
    """
    heard = readings.only(readings.quantity != "flash_time_s").position
    if np.isnan(heard).any() or len(np.unique(heard, axis=0)) < 3:
        nowhere = _compared(readings, laws, np.zeros(3), 1.0, None, 3)
        return replace(nowhere, off=np.zeros_like(nowhere.off), checkable=0)
    few = _thinned(readings)
    at = few.position[~np.isnan(few.position).any(axis=1), :2]
    # medians: one sensor at a wrong position does not shift the search
    centre = np.median(at, axis=0)
    spread = float(np.median(np.linalg.norm(at - centre, axis=1)))
    half = SPREADS * max(spread, 1.0)
    smallest, largest = np.log(MIN_MASS), np.log(MAX_MASS)
    middle = np.array([*centre, (smallest + largest) / 2])
    reach = np.array([half, half, (largest - smallest) / 2])
    for counts in GRIDS:
        axes = [np.linspace(-1, 1, n) for n in counts]
        cube = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        grid = middle + reach * cube
        places = np.column_stack([grid[:, :2], np.full(len(grid), height)])
        spacing = 2 * reach[0] / (counts[0] - 1)
        middle = grid[_closest(few, laws, places, np.exp(grid[:, 2]), None, spacing)]
        # the next grid reaches beyond the neighbours of the best point: the optimum may
        # lie between grid points
        reach = reach / 4
    place = np.array([middle[0], middle[1], height])
    return _compared(readings, laws, place, float(np.exp(middle[2])), None, 3)


def _closest(
    readings: Readings,
    laws: ScaledLaws,
    places: Float[np.ndarray, "try 3"],
    masses: Float[np.ndarray, " try"],
    origin: float | None,
    spacing: float = 0.0,
) -> int:
    """Return the number of the trial on which most rows agree.

    A row that disagrees adds 1 to its cost, however large its residual.
    """
    residual, allowed, _ = readings.compared(
        laws, places, masses, origin, spacing=spacing
    )
    cost = np.fmin((residual / allowed) ** 2, 1.0).sum(axis=1)
    return int(np.argmin(cost))


def _compared(
    readings: Readings,
    laws: ScaledLaws,
    place: Float[np.ndarray, "3"],
    mass: float,
    origin: float | None,
    unknowns: int,
) -> Blast:
    """Return the agreement with a blast, of which some numbers were searched."""
    residual, allowed, offset = (
        one[0] for one in readings.compared(laws, place[None], np.array([mass]), origin)
    )
    free = readings.timed & ((readings.clock > 0) | (origin is None))
    counts = np.bincount(readings.clock[free])
    # an offset that is found from one reading fits it exactly
    lonely = free & np.isin(readings.clock, np.flatnonzero(counts == 1))
    off = ~(np.abs(residual) <= allowed) & ~lonely
    unknowns += int((counts > 1).sum())
    return Blast(
        readings=readings,
        place=place,
        mass=mass,
        distance=readings.slant_range,
        origin=origin,
        residual=residual,
        offset=offset,
        off=off,
        checkable=int((~lonely).sum()),
        unknowns=unknowns,
        price=PRICE * int(off.sum()) + unknowns,
    )


def _thinned(readings: Readings) -> Readings:
    """Return at most `SEARCH_ROWS` rows, evenly spaced."""
    last = len(readings.row) - 1
    return readings.only(np.unique(np.linspace(0, last, SEARCH_ROWS).astype(int)))


def readings_of(
    observations: Observations,
    scene: Scene,
    rows: Int[np.ndarray, " row"],
    beliefs: Collection[str],
) -> Readings:
    """Return the rows that can be compared with laws: those with a law and a position.

    Args:
        observations: The log.
        scene: Scene with the offsets of clocks from the common one.
        rows: Rows of one shot.
        beliefs: Names of uncertain numbers; a clock among them has its own offset.
    """
    quantity = np.array(observations.quantity)
    placed = ~np.isnan(observations.position).any(axis=1)
    placed |= ~np.isnan(observations.slant_range)
    used = (quantity == "flash_time_s") | (np.isin(quantity, list(LAWS)) & placed)
    rows = rows[used[rows]]
    quantity = quantity[rows]
    timed = np.isin(quantity, ("flash_time_s", "air_arrival_s"))
    offsets = {name: float(x) for name, x in scene.clock_offsets().items()}
    own = np.array(observations.clocks())[rows]
    apart = [
        bool(observations.clock[row]) or f"{CLOCK_OFFSET}.{name}" in beliefs
        for row, name in zip(rows, own, strict=True)
    ]
    # the common clock, "", is the first in order
    names = np.where(apart, own, "")
    _, clock = np.unique(np.append(names, ""), return_inverse=True)
    # stated offsets are subtracted: these clocks then agree with the common one
    shift = np.array([offsets.get(name, 0.0) for name in own])
    raw = observations.value[rows]
    return Readings(
        row=rows,
        quantity=quantity,
        value=np.where(timed, raw - shift, np.log(np.where(raw > 0, raw, 1.0))),
        position=observations.position[rows],
        slant_range=observations.slant_range[rows],
        clock=np.where(timed, clock[:-1], NO_CLOCK),
        error=SIGMAS * np.nan_to_num(observations.error_scale()[rows]),
        bound=observations.bounds()[rows],
    )
