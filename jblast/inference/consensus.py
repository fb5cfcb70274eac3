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
"""Charges that are tried [kg]: a factor 1.3 from one to the next."""
SIDE, FEW_MASSES, ROUNDS = 25, 28, 5
"""Places along each side of the grid, masses at each, and how often it is narrowed."""
SEARCH_ROWS = 60
"""Rows by which a place is searched; all rows are then compared with it."""
AT_ONCE = 250_000
"""Readings times tries that are held in memory."""
SPREADS = 4.0
"""Reach of the search for a charge about the sensors, in their median distances."""
SPEED = 340.0
"""Turns the spacing of a grid into seconds [m/s]."""
SIGMAS = 5.0
"""A reading this many sigmas away is no error of reading."""
FACTOR = 3.0
"""Tolerance of a pressure, an impulse or a duration: a reflection doubles it, and
a law, a burst in the air, or ground between may halve it."""
TRAVEL_TIME_TOLERANCE = 0.07
"""Relative tolerance of a travel time: wind, and air that differs from the scene's."""
FAR, FAR_SHARE = 20e3, 0.25
"""Past this distance [m] sound goes through the stratosphere, at 280 m/s and less
(Negraru et al., J. Geophys. Res. 115, D15110, 2010; read second-hand)."""
CLOCK_STEP = 1e-3
"""Tolerance of any arrival [s]."""
PRICE = 3
"""Of a row that is off, or of a supposed mistake, in numbers found from the rows."""
NO_CLOCK = -1
LAWS = {
    "air_arrival_s": "shock_kinematics",
    "peak_overpressure_pa": "shock_kinematics",
    "positive_impulse_pa_s": "shock_kinematics",
    "positive_duration_s": "shock_kinematics",
    "reflected_pressure_pa": "kingery_bulmash",
    "reflected_impulse_pa_s": "kingery_bulmash",
}
"""Laws that hold from the charge to where it is inaudible; reflected ones go on as
power laws."""
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
        """Return the unknowns, and `PRICE` more for each row that is off."""
        return PRICE * int((self.checkable & self.off).sum()) + self.unknowns

    def share(self) -> float:
        """Return the share of rows that agree."""
        return float((self.checkable & ~self.off).sum() / max(self.checkable.sum(), 1))


@dataclass(frozen=True)
class ScaledLaws:
    """Laws of 1 kg of an explosive in the air of a scene.

    Attributes:
        log_z: ln of scaled distance.
        log_value: By quantity, ln of its value at each.
        near: By quantity, the least scaled distance at which its law holds.
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
        """Return ln of what a quantity is at some distances from some masses."""
        third = np.log(mass) / 3
        log_z = np.log(np.maximum(distance, 1e-6)) - third
        step = self.log_z[1] - self.log_z[0]
        place = np.clip((log_z - self.log_z[0]) / step, 0, len(self.log_z) - 1.000001)
        left = place.astype(int)
        share = place - left
        table = self.log_value[quantity]
        value = table[left] * (1 - share) + table[left + 1] * share
        return value + third if quantity in WITH_MASS else value

    def fastest(self) -> float:
        """Return the mean speed [m/s] to the nearest place that a law holds at."""
        log_z = self._valid("air_arrival_s")
        return float(
            np.exp(log_z - self.log_value["air_arrival_s"][-len(log_z) :]).max()
        )

    def largest(self, quantity: str, distance: float) -> float:
        """Return the most that a valid law gives at a distance, whatever the mass."""
        return float(np.exp(self._along(quantity, distance).max()))

    def masses(self, quantity: str, value: float, distance: float) -> np.ndarray:
        """Return each mass [kg] that gives a value at a distance, where laws hold."""
        along = self._along(quantity, distance) - np.log(value)
        mass = (distance / np.exp(self._valid(quantity))) ** 3
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
    """Rows of one shot, in the space their errors live in.

    Attributes:
        row: Which row of the log each is.
        quantity: What it is.
        value: Seconds for readings of a clock, ln for all else.
        position: East, north, up of the sensor [m]; NaN where a range is given.
        slant_range: Distance from the charge [m]; NaN where a position is given.
        clock: Number of its clock, 0 the common one; -1 for what is no clock's.
        error: `SIGMAS` of its sigma, same unit.
        bound: Whether it is a lower bound.
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
        """Which are readings of a clock."""
        return self.clock >= 0

    def distances(
        self, places: Float[np.ndarray, "place 3"]
    ) -> Float[np.ndarray, "place n"]:
        """Return how far each sensor is from a charge at some places [m]."""
        apart = np.linalg.norm(self.position - places[:, None], axis=-1)
        return np.where(np.isnan(self.slant_range), apart, self.slant_range)

    def travelled(
        self,
        laws: ScaledLaws,
        distance: Float[np.ndarray, "place n"],
        mass: Float[np.ndarray, " place"],
    ) -> Float[np.ndarray, "place n"]:
        """Return what each would be: seconds since the shot, or ln."""
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
        """Return how far each may be off: its errors, and what laws leave open."""
        share = np.where(distance > FAR, FAR_SHARE, TRAVEL_TIME_TOLERANCE)
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
        readings: The rows, with the range that the scene has of the charge.
        found: What the blast explains; None where none could be found.
        distance: From the charge of each [m]; NaN where its position is not given.
        origin: Time of the shot on the common clock [s]; None where it is not given.
        said: What the blast explains that a fit would suppose; None where the scene
            leaves its place open.
        said_origin: Time of that one on the common clock [s].
        doubt: That it is another blast than a fit would suppose.
    """

    readings: Readings
    found: Agreement | None
    distance: Float[np.ndarray, " n"]
    origin: float | None
    said: Agreement | None = None
    said_origin: float | None = None
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
        laws: Of a kilogram.
        charge: Of the scene.
        uncertain: The scene.
        label: What the names of the charge's numbers end in.
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
    if not np.isnan(readings.slant_range).any():
        place = np.zeros(3)  # of no account
    if place is None:
        found = _anywhere(readings, laws, charge)
        nowhere = np.where(np.isnan(readings.slant_range), np.nan, readings.slant_range)
        return Supposed(readings, found, nowhere, origin)
    found = at_place(readings, laws, place, origin)
    distance = readings.distances(place[None])[0]
    said = Supposed(readings, found, distance, origin, found, origin)
    if uncertain.source != NO_SCENE or found.all_agree():
        return said
    return _another(said, laws, charge, place)


def _another(
    said: Supposed, laws: ScaledLaws, charge: Charge, place: Float[np.ndarray, "3"]
) -> Supposed:
    """Return the blast that most rows agree on where the scene has none."""
    readings, found = said.readings, said.found
    first = int(readings.row[0])
    later = at_place(readings, laws, place, None)
    elsewhere = _anywhere(readings, laws, charge)
    best = said
    if found is None or _better(later, found):
        doubt = Doubt("not_at_time_0", (first,))
        best = replace(said, found=later, origin=None, doubt=doubt)
    if elsewhere is not None and (best.found is None or _better(elsewhere, best.found)):
        east, north, _ = elsewhere.place.tolist()
        doubt = Doubt("not_at_the_origin", (first,), {"east_m": east, "north_m": north})
        far = np.where(np.isnan(readings.slant_range), np.nan, said.distance)
        best = replace(said, found=elsewhere, distance=far, origin=None, doubt=doubt)
    return best


def _better(one: Agreement, other: Agreement) -> bool:
    """Return whether one agreement is believable and has the lower price."""
    if not one.is_believable():
        return False
    if one.price() == other.price():
        return one.holds() and not other.holds()
    return one.price() < other.price()


def _anywhere(readings: Readings, laws: ScaledLaws, charge: Charge) -> Agreement | None:
    """Look for the charge, if there are places to look from."""
    placed = ~np.isnan(readings.position).any(axis=1)
    places = {tuple(at) for at in readings.position[placed].tolist()}
    untold = np.isnan(readings.slant_range)
    flash = np.array([quantity == "flash_time_s" for quantity in readings.quantity])
    if len(places) < 3 or not (placed & untold)[~flash].all():
        return None
    return anywhere(readings, laws, float(charge.position_m[2]))


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
    log_mass, log_half = (
        np.log(MIN_MASS * MAX_MASS) / 2,
        np.log(MAX_MASS / MIN_MASS) / 2,
    )
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
    """Return evenly picked rows, no more than `SEARCH_ROWS`."""
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
    """Return the rows that laws are held against: those with a law, and a place.

    Args:
        observations: The log.
        scene: It has the offsets of clocks from the common one.
        rows: Of one shot.
        beliefs: Names of what is not fixed; a clock among them is a clock of its own.
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

    By the curves of a burst on the ground, unless the scene has another: the others
    are those of half the mass or so, which no doubt depends on.
    """
    charge = replace(scene.charge, burst=scene.charge.burst or "surface")
    scene = replace(scene, charge=charge)
    z = np.geomspace(NEAREST, FARTHEST, POINTS)
    laws = tuple(law_for(quantity, name) for quantity, name in LAWS.items())
    value, valid = evaluate(scene, z, np.ones_like(z), laws)
    n = len(laws)  # what they give together comes after
    return ScaledLaws(
        log_z=np.log(z),
        log_value=dict(zip(LAWS, np.log(value[:n]), strict=True)),
        near={q: float(z[ok].min()) for q, ok in zip(LAWS, valid[:n], strict=True)},
    )
