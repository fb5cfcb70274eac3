"""The blast that most rows of a shot agree on, for checks of a log before a fit.

The rows of a shot are compared with blasts of any mass. By Hopkinson's scaling a charge
of mass $M$ at the distance $r$ has the pressures that 1 kg has at
$Z = r / M^{1/3}$, and times and impulses $M^{1/3}$ as large (Baker, Explosions in Air,
1973, ch. 3). So one table of 1 kg per quantity, over $Z$, serves all masses.

The mass, and where needed the position and the origin time, are searched on a grid. The
score is the number of rows that agree, not a sum of squares: one row off by a factor of
a thousand would dominate a fit (Fischler and Bolles, Comm. ACM 24, 381, 1981, who draw
at random). Position and time of the scene are used where it has them. Without a scene a
fit assumes the origin and time 0, and another position or time replaces these if
more rows agree on it.

The tolerances are those of a check: a factor of three for pressures, impulses and
durations, a share of the travel time for arrivals. The result is no estimate.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from jblast.constants import TNT_SPECIFIC_ENERGY
from jblast.observations import Observations
from jblast.observations.check import Doubt
from jblast.parameters import CHARGE_POSITION, CLOCK_OFFSET
from jblast.registry import law_for
from jblast.scene import Charge, Scene, UncertainScene
from jblast.scene.uncertain import NO_SCENE
from jblast.sensors.calculator import evaluate

MAX_MASS = 50e6 * 1e3 * 4.184e6 / TNT_SPECIFIC_ENERGY
"""Mass of TNT of the largest explosion made so far [kg]: 50 Mt, 30 October 1961
(Adamsky and Smirnov, Cold War International History Project Bulletin 4, 1994)."""
MIN_MASS = 1e-6
"""A milligram [kg]: what microscale experiments detonate (declared)."""
MASSES = np.geomspace(MIN_MASS, MAX_MASS, 160)
"""Masses of the search at a known position [kg]. Their ratio of 1.3 changes times and
impulses by some 9 %, pressures by 30 % at most: far less than `FACTOR`."""
SIDE, GRID_MASSES, ROUNDS = 25, 28, 5
"""Positions along each side of the grid, masses at each position, and number of rounds.
Each round narrows the grid by 4: the fifth is 1/256 as wide as the first."""
SEARCH_ROWS = 60
"""Largest number of rows for the search of a position. All rows are then compared with
the result; the search takes as long as it has rows."""
MAX_BATCH_NUMBERS = 250_000
"""Largest number of readings times trials in memory: 2 MB an array."""
SPREADS = 4.0
"""Half width of the searched square about the sensors, in their median distances."""
SPEED = 340.0
"""Speed that converts the spacing of a grid into a tolerance of arrivals [m/s]."""
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
NEAREST, FARTHEST, POINTS = 1e-3, 1e6, 901
"""Scaled distances of the tables [m/kg^(1/3)]: 100 a decade."""


@dataclass(frozen=True)
class Agreement:
    """Rows of a shot, compared with one blast.

    Attributes:
        place: East, north, up of the charge [m].
        mass: Mass of the explosive [kg].
        residual: Residual of each reading, in its unit (ln, or seconds).
        offset: Reading of its clock minus the time since the shot; 0 for readings in
            ln.
        off: True for readings that disagree.
        checkable: True for readings that can disagree: the only reading of a clock
            cannot.
        unknowns: Number of parameters found from the rows.
    """

    place: Float[np.ndarray, "3"]
    mass: float
    residual: Float[np.ndarray, " n"]
    offset: Float[np.ndarray, " n"]
    off: Bool[np.ndarray, " n"]
    checkable: Bool[np.ndarray, " n"]
    unknowns: int

    def holds(self) -> bool:
        """Return True if a majority agrees, so that the other rows are suspect."""
        agree = int((self.checkable & ~self.off).sum())
        return agree > self.unknowns and 2 * agree > int(self.checkable.sum())

    def all_agree(self) -> bool:
        """Return True if no row disagrees."""
        return not (self.checkable & self.off).any()

    def is_believable(self) -> bool:
        """Return True if at least as many rows agree as numbers were found, and two."""
        return int((self.checkable & ~self.off).sum()) >= max(self.unknowns, 2)

    def price(self) -> int:
        """Return the number of unknowns plus `PRICE` for each row that disagrees."""
        return PRICE * int((self.checkable & self.off).sum()) + self.unknowns

    def share(self) -> float:
        """Return the share of rows that agree."""
        return float((self.checkable & ~self.off).sum() / max(self.checkable.sum(), 1))


@dataclass(frozen=True)
class ScaledLaws:
    """Laws of 1 kg of an explosive in the air of a scene.

    Attributes:
        log_z: ln of scaled distance.
        log_value: ln of the value at each, by quantity.
        near: Smallest scaled distance within the range of the law, by quantity.
    """

    log_z: Float[np.ndarray, " z"]
    log_value: dict[str, Float[np.ndarray, " z"]]
    near: dict[str, float]

    def predicted(
        self,
        quantity: str,
        distance: Float[np.ndarray, "..."],
        mass: Float[np.ndarray, "..."],
    ) -> Float[np.ndarray, "..."]:
        """Return ln of a quantity at given distances from given masses."""
        third = np.log(mass) / 3
        log_z = np.log(np.maximum(distance, 1e-6)) - third
        step = self.log_z[1] - self.log_z[0]
        # the table is uniform in ln Z: an index instead of a search
        place = np.clip((log_z - self.log_z[0]) / step, 0, len(self.log_z) - 1.000001)
        left = place.astype(int)
        share = place - left
        table = self.log_value[quantity]
        value = table[left] * (1 - share) + table[left + 1] * share
        return value + third if quantity in WITH_MASS else value

    def fastest(self) -> float:
        """Return the largest mean speed [m/s] from the charge by a valid law."""
        log_z = self._valid("air_arrival_s")
        return float(
            np.exp(log_z - self.log_value["air_arrival_s"][-len(log_z) :]).max()
        )

    def largest(self, quantity: str, distance: float) -> float:
        """Return the largest value of a valid law at a distance, for any mass."""
        return float(np.exp(self._along(quantity, distance).max()))

    def masses(self, quantity: str, value: float, distance: float) -> np.ndarray:
        """Return the masses [kg] that give a value at a distance, by a valid law."""
        along = self._along(quantity, distance) - np.log(value)
        mass = (distance / np.exp(self._valid(quantity))) ** 3
        # several masses are possible where a quantity is not monotonic in the mass
        crossed = np.flatnonzero(np.diff(np.sign(along)) != 0)
        share = along[crossed] / (along[crossed] - along[crossed + 1])
        log_mass = np.log(mass)
        return np.exp(
            log_mass[crossed] + share * (log_mass[crossed + 1] - log_mass[crossed])
        )

    def _valid(self, quantity: str) -> Float[np.ndarray, " z"]:
        return self.log_z[self.log_z >= np.log(self.near[quantity])]

    def _along(self, quantity: str, distance: float) -> Float[np.ndarray, " z"]:
        """Return ln of a quantity at one distance for every mass in its table."""
        log_z = self._valid(quantity)
        value = self.log_value[quantity][-len(log_z) :]
        third = np.log(distance) - log_z
        return value + third if quantity in WITH_MASS else value


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
    quantity: tuple[str, ...]
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

    def distances(
        self, places: Float[np.ndarray, "place 3"]
    ) -> Float[np.ndarray, "place n"]:
        """Return the distance of each sensor from a charge at given positions [m]."""
        apart = np.linalg.norm(self.position - places[:, None], axis=-1)
        return np.where(np.isnan(self.slant_range), apart, self.slant_range)

    def travelled(
        self,
        laws: ScaledLaws,
        distance: Float[np.ndarray, "place n"],
        mass: Float[np.ndarray, " place"],
    ) -> Float[np.ndarray, "place n"]:
        """Return the prediction of each: seconds since the shot, or ln."""
        predicted = np.zeros_like(distance)
        for quantity in dict.fromkeys(self.quantity):
            here = np.array([q == quantity for q in self.quantity])
            if quantity != "flash_time_s":
                law = laws.predicted(quantity, distance[:, here], mass[:, None])
                predicted[:, here] = np.exp(law) if quantity == "air_arrival_s" else law
        return predicted

    def allowed(
        self,
        predicted: Float[np.ndarray, "place n"],
        distance: Float[np.ndarray, "place n"],
    ) -> Float[np.ndarray, "place n"]:
        """Return the tolerance of each: its error plus that of the laws."""
        share = np.where(
            distance > STRATOSPHERE_RANGE, STRATOSPHERE_TOLERANCE, TRAVEL_TIME_TOLERANCE
        )
        times = CLOCK_STEP + share * predicted
        return self.error + np.where(self.timed, times, np.log(FACTOR))

    def only(self, kept: Int[np.ndarray, " _"]) -> "Readings":
        """Return some of the readings, by number."""
        return Readings(
            row=self.row[kept],
            quantity=tuple(self.quantity[i] for i in kept),
            value=self.value[kept],
            position=self.position[kept],
            slant_range=self.slant_range[kept],
            clock=self.clock[kept],
            error=self.error[kept],
            bound=self.bound[kept],
        )

    def but(self, **changed: object) -> "Readings":
        """Return the same with some fields changed."""
        return replace(self, **changed)  # pyright: ignore[reportArgumentType]  fields


@dataclass(frozen=True)
class Supposed:
    """The blast with which the rows of a shot are compared.

    Attributes:
        readings: The rows, with the charge's range of the scene.
        found: Agreement with the blast; None if none could be found.
        distance: Distance of each row from the charge [m]; NaN if its position is not
            given.
        origin: Time of the shot on the common clock [s]; None if it is not given.
        stated: Agreement with the blast that a fit would assume; None if the scene
            leaves its position free.
        stated_origin: Time of that blast on the common clock [s].
        doubt: Warning that the blast differs from the one that a fit would assume.
    """

    readings: Readings
    found: Agreement | None
    distance: Float[np.ndarray, " n"]
    origin: float | None
    stated: Agreement | None = None
    stated_origin: float | None = None
    doubt: Doubt | None = None


def supposed_blast(
    readings: Readings,
    laws: ScaledLaws,
    charge: Charge,
    uncertain: UncertainScene,
    label: str,
) -> Supposed:
    """Return the blast with which the rows of a shot are compared.

    Args:
        readings: The rows.
        laws: Laws of 1 kg.
        charge: Charge of the scene.
        uncertain: The scene.
        label: Suffix of the names of the charge's numbers.
    """
    free = set(uncertain.beliefs)
    origin = None if "origin_time_s" + label in free else float(charge.time_s)
    place = np.array([float(x) for x in charge.position_m])
    if charge.range_m is not None:
        ranges = np.full(len(readings.row), float(charge.range_m))
        ranged = "charge_range_m" + label not in free
        readings = readings.but(slant_range=ranges if ranged else np.nan * ranges)
        place = None if not ranged else place
    elif free & {name + label for name in CHARGE_POSITION}:
        place = None
    # a log with ranges alone has no positions to search
    if not np.isnan(readings.slant_range).any():
        place = np.zeros(3)  # all rows have a range: the position has no effect
    if place is None:
        found = _anywhere(readings, laws, charge)
        nowhere = np.where(np.isnan(readings.slant_range), np.nan, readings.slant_range)
        return Supposed(readings, found, nowhere, origin)
    found = at_place(readings, laws, place, origin)
    distance = readings.distances(place[None])[0]
    stated = Supposed(readings, found, distance, origin, found, origin)
    if uncertain.source != NO_SCENE or found.all_agree():
        return stated
    return _another(stated, laws, charge, place)


def _another(
    stated: Supposed, laws: ScaledLaws, charge: Charge, place: Float[np.ndarray, "3"]
) -> Supposed:
    """Return the blast on which most rows agree, for a log without a scene."""
    readings, found = stated.readings, stated.found
    first = int(readings.row[0])
    later = at_place(readings, laws, place, None)
    elsewhere = _anywhere(readings, laws, charge)
    best = stated
    if found is None or _better(later, found):
        doubt = Doubt("not_at_time_0", (first,))
        best = replace(stated, found=later, origin=None, doubt=doubt)
    if elsewhere is not None and (best.found is None or _better(elsewhere, best.found)):
        east, north, _ = elsewhere.place.tolist()
        doubt = Doubt("not_at_the_origin", (first,), {"east_m": east, "north_m": north})
        far = np.where(np.isnan(readings.slant_range), np.nan, stated.distance)
        best = replace(stated, found=elsewhere, distance=far, origin=None, doubt=doubt)
    return best


def _better(one: Agreement, other: Agreement) -> bool:
    """Return True if one agreement is believable and has the lower price."""
    if not one.is_believable():
        return False
    if one.price() == other.price():
        return one.holds() and not other.holds()
    return one.price() < other.price()


def _anywhere(readings: Readings, laws: ScaledLaws, charge: Charge) -> Agreement | None:
    """Search the position of the charge; None with fewer than three positions."""
    placed = ~np.isnan(readings.position).any(axis=1)
    places = {tuple(at) for at in readings.position[placed].tolist()}
    no_range = np.isnan(readings.slant_range)
    flash = np.array([quantity == "flash_time_s" for quantity in readings.quantity])
    if len(places) < 3 or not (placed & no_range)[~flash].all():
        return None
    return anywhere(readings, laws, float(charge.position_m[2]))


def at_place(
    readings: Readings,
    laws: ScaledLaws,
    place: Float[np.ndarray, "3"],
    origin: float | None,
    masses: Float[np.ndarray, " mass"] = MASSES,
) -> Agreement:
    """Return the agreement with a charge at a known position, its mass searched.

    Args:
        readings: The rows.
        laws: Laws of 1 kg.
        place: East, north, up [m].
        origin: Time of the shot on the common clock [s]; None to estimate it.
        masses: Masses to try [kg].
    """
    places = np.broadcast_to(place, (len(masses), 3))
    return _best(readings, laws, places, masses, origin, 1)


def anywhere(readings: Readings, laws: ScaledLaws, height: float) -> Agreement:
    """Return the agreement with a charge whose position, time and mass are searched.

    Args:
        readings: The rows.
        laws: Laws of 1 kg.
        height: Height of the charge [m].
    """
    few = _thinned(readings)
    at = few.position[~np.isnan(few.position).any(axis=1)]
    # medians: one sensor at a wrong position does not shift the search
    centre = np.median(at, axis=0)
    spread = float(np.median(np.linalg.norm(at[:, :2] - centre[:2], axis=1)))
    half = SPREADS * max(spread, 1.0)
    log_mass, log_half = (
        np.log(MIN_MASS * MAX_MASS) / 2,
        np.log(MAX_MASS / MIN_MASS) / 2,
    )
    middle = np.array([centre[0], centre[1], log_mass])
    reach = np.array([half, half, log_half])
    counts = np.array([SIDE, SIDE, GRID_MASSES])
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
        # the next grid reaches beyond the neighbours of the best point: the optimum may
        # lie between grid points
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
    """Return the agreement with the best trial."""
    score, cost = _misfit(readings, laws, places, masses, origin)
    best = int(np.argmin(cost))
    place, mass = places[best], float(masses[best])
    one = slice(best, best + 1)
    residual, offset, _ = _residuals(readings, laws, places[one], masses[one], origin)
    free = [c for c in range(readings.clock.max(initial=-1) + 1) if c or origin is None]
    counts = {c: int((readings.clock == c).sum()) for c in free}
    # an offset that is found from one reading fits it exactly
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
    """Return residuals relative to tolerances, and a cost that saturates.

    A row that disagrees adds 1, however large its residual.
    """
    scores, costs = [], []
    step = max(1, MAX_BATCH_NUMBERS // max(len(readings.row), 1))
    for start in range(0, len(masses), step):
        part = slice(start, start + step)
        residual, _, allowed = _residuals(
            readings, laws, places[part], masses[part], origin
        )
        if spacing:  # the optimum may lie between grid points: blur by their spacing
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
    """Return residuals, clock offsets (already subtracted), and tolerances."""
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
            # a median: wrong arrivals, fewer than half, do not shift it
            offset[:, here] = np.median(residual[:, here], axis=1, keepdims=True)
    residual = residual - offset
    residual = np.where(readings.bound, np.maximum(residual, 0.0), residual)
    allowed = readings.allowed(np.where(readings.timed, travelled, 0.0), distance)
    return residual, offset, allowed


def _thinned(readings: Readings) -> Readings:
    """Return at most `SEARCH_ROWS` rows, evenly spaced."""
    n = len(readings.row)
    if n <= SEARCH_ROWS:
        return readings
    return readings.only(np.unique(np.linspace(0, n - 1, SEARCH_ROWS).astype(int)))


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
    place = observations.position
    placed = ~np.isnan(place).any(axis=1) | ~np.isnan(observations.slant_range)
    used = np.array(
        [
            row
            for row in rows
            if observations.quantity[row] == "flash_time_s"
            or (observations.quantity[row] in LAWS and placed[row])
        ],
        int,
    )
    quantity = tuple(observations.quantity[row] for row in used)
    timed = np.isin(quantity, ("flash_time_s", "air_arrival_s"))
    offsets = {name: float(x) for name, x in scene.clock_offsets().items()}
    own = observations.clocks()
    names = [
        own[row] if observations.clock[row] or f"{CLOCK_OFFSET}.{own[row]}" in beliefs
        else ""
        for row in used
    ]  # fmt: skip
    number = {name: i for i, name in enumerate(dict.fromkeys(["", *names]))}
    # stated offsets are subtracted: these clocks then agree with the common one
    shift = np.array([offsets.get(own[row], 0.0) for row in used])
    raw = observations.value[used]
    value = np.where(timed, raw - shift, np.log(np.where(raw > 0, raw, 1.0)))
    error = SIGMAS * np.nan_to_num(observations.error_scale()[used])
    return Readings(
        row=used,
        quantity=quantity,
        value=value,
        position=place[used],
        slant_range=observations.slant_range[used],
        clock=np.where(timed, np.array([number[n] for n in names], int), NO_CLOCK),
        error=error,
        bound=observations.bounds()[used],
    )


def scaled_laws(scene: Scene) -> ScaledLaws:
    """Tabulate the laws for 1 kg of a scene's explosive, in its air.

    A charge without a stated burst has the curves of a surface burst. Free-air curves
    are those of about half the mass, and no warning depends on a factor of two.
    """
    charge = replace(scene.charge, burst=scene.charge.burst or "surface")
    scene = replace(scene, charge=charge)
    z = np.geomspace(NEAREST, FARTHEST, POINTS)
    laws = tuple(law_for(quantity, name) for quantity, name in LAWS.items())
    value, valid = evaluate(scene, z, np.ones_like(z), laws)
    n = len(laws)  # composed quantities follow
    return ScaledLaws(
        log_z=np.log(z),
        log_value=dict(zip(LAWS, np.log(value[:n]), strict=True)),
        near={q: float(z[ok].min()) for q, ok in zip(LAWS, valid[:n], strict=True)},
    )
