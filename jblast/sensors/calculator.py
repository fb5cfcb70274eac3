r"""Every quantity at a range by every law, and the range or mass that gives a value.

A question states masses, ranges and conditions. Forward, `calculate` evaluates all laws
that need a range alone, and quantities that combine others (`combined_of`).

Backward, `roots` finds the ranges or masses at which each law gives a value: all of
them, or none. A law need not fall with distance: blends of printed fits may have bumps,
and a duration turns back near the charge. So the sign of law minus value is evaluated
on an even grid in $\ln Z$, a point every 0.4 %, and each change of sign is bisected to
rounding. Two roots between two points are not found.

One of the answers is recommended, by the law that `auto` chooses there, with the law's
scatter; for a root that scatter is divided by the slope of the law. Valid laws that
differ by more than their scatter (90 %) are reported as a disagreement.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import TYPE_CHECKING, Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

import jblast.waves as _waves  # noqa: F401  laws enter the registry as they are imported
from jblast.constants import STANDARD_PRESSURE, TNT_DENSITY
from jblast.errors import InputError
from jblast.kept_programs import kept
from jblast.quantities import DERIVED_QUANTITIES, QUANTITIES, components
from jblast.registry import LAWS, Law, call, names_for, total_scatter
from jblast.results import ABSENT, HIDDEN
from jblast.scene import Scene
from jblast.scene.charge import Burst
from jblast.sensors.layout import Layout
from jblast.sensors.record import path_to
from jblast.types import as_float_array
from jblast.waves.height_of_burst import bursts_in_free_air
from jblast.waves.paths import Path
from jblast.waves.waveform import friedlander_decay

if TYPE_CHECKING:  # the tables of `fidelity` are read only where a law is recommended
    from jblast.fidelity import Choice

NEEDS_MORE = {"time_since_detonation", "toward_east", "jolt_east"}
FEWEST_ROWS = 64
"""Rows are padded to a power of two from here on, so few shapes are compiled."""
SCALED_DISTANCES = np.geomspace(1e-2, 1e5, 4096)
"""Scaled distances of the search for roots [m/kg^(1/3)]."""
BISECTIONS = 48
"""Of 0.4 %: to 1e-17 in ln, past rounding."""
STEP = 1e-3
"""In ln of a range or a mass: differences over it are a law's slope."""
BEYOND = 1.645
"""Standard deviations of the difference of two laws: 90 % of their scatter lies within.
"""


@dataclass(frozen=True)
class Question:
    """One question to the laws.

    Attributes:
        scene: Charge, air and ground; the mass of its charge is not used.
        slant_range: Distances from the charge [m]; none where they are to be found.
        charge_mass: Masses of the explosive [kg]; none where they are to be found.
        quantity: Measured in place of the one to be found; "" if none.
        target: Its value, in its unit.
        defaults: Fields left to their defaults: "air", "burst", "explosive", "ground".
        units: Units of the printed answer: "si", or "us": feet, pounds, psi.
    """

    scene: Scene
    slant_range: tuple[float, ...] = ()
    charge_mass: tuple[float, ...] = ()
    quantity: str = ""
    target: float = math.nan
    defaults: frozenset[str] = frozenset()
    units: Literal["si", "us"] = "si"

    def rows(self) -> tuple[np.ndarray, np.ndarray]:
        """Return ranges and masses of all combinations, the ranges running faster."""
        masses, ranges = np.meshgrid(self.charge_mass, self.slant_range, indexing="ij")
        return ranges.ravel(), masses.ravel()


def charge_radius(charge_mass: Float[ArrayLike, "..."]) -> Float[np.ndarray, "..."]:
    r"""Return the radius of a sphere of TNT [m]: $(3 W / (4 \pi \rho))^{1/3}$.

    Args:
        charge_mass: $W$ [kg].
    """
    volume = np.asarray(charge_mass) / TNT_DENSITY
    return np.asarray(np.cbrt(3.0 * volume / (4.0 * math.pi)))


@kept
def scene_path(scene: Scene) -> Path:
    """Return the path from the charge of a scene to a sensor 1 m away.

    Its ambient air is that of every other sensor.
    """
    layout = Layout(
        quantity=("air_arrival_s",),
        position=jnp.zeros((1, 3)),
        slant_range=jnp.ones(1),
        time=jnp.full(1, jnp.nan),
        group=(0,),
        shot=(0,),
        clock=("",),
    )
    return path_to(scene, layout)


def with_rows(
    path: Path,
    slant_range: Float[ArrayLike, " row"],
    charge_mass: Float[ArrayLike, " row"],
) -> Path:
    """Return a path with ranges and TNT masses put in; both ranges are the slant one.

    Where the height leaves the curve set, sensors stand as low as their ranges allow.

    Args:
        path: From `scene_path`.
        slant_range: Distances [m].
        charge_mass: TNT-equivalent masses [kg].
    """
    free_air = path.free_air
    if free_air is not None:
        ranges = jnp.asarray(slant_range)
        free_air = bursts_in_free_air(
            ranges,
            charge_mass,
            path.height_of_burst,
            jnp.maximum(path.height_of_burst - ranges, 0.0),
            path.ambient_pressure,
            path.sound_speed,
        )
    return replace(
        path,
        slant_range=slant_range,
        ground_range=slant_range,
        charge_mass=charge_mass,
        free_air=free_air,
    )


def path_of_rows(question: Question, quantity: str = "peak_overpressure_pa") -> Path:
    """Return the path of each row, its masses those of TNT for a quantity."""
    ranges, masses = question.rows()
    factor = float(question.scene.charge.tnt_factor_for(quantity))
    path = scene_path(question.scene)
    return with_rows(path, as_float_array(ranges), as_float_array(factor * masses))


def free_air_rows(question: Question) -> Bool[np.ndarray, " row"]:
    """Return at which rows the reflection comes after the positive phase.

    A sensor stands as low as its range allows: on the ground, unless the charge is
    higher than the range is long.
    """
    ranges, _ = question.rows()
    charge = question.scene.charge
    if question.quantity or not float(charge.up) > 0.0:
        return np.zeros(ranges.shape, bool)
    unsaid = replace(charge, burst=None)
    scene = replace(question.scene, charge=unsaid)
    rows = path_of_rows(replace(question, scene=scene))
    return np.asarray(rows.free_air)


def with_burst(question: Question) -> Question:
    """Return a question with the curve set of the charge's height, if it has none.

    One set for all rows, or, where the height leaves both, each row its own. Where a
    range or a mass is to be found, the surface curves.
    """
    charge = question.scene.charge
    if charge.burst is not None:
        return question
    free = free_air_rows(question)
    burst = (
        "free-air" if free.size and free.all() else None if free.any() else "surface"
    )
    charge = replace(charge, burst=burst, by_height=True)
    scene = replace(question.scene, charge=charge)
    return replace(question, scene=scene)


@dataclass(frozen=True)
class Calculated:
    """One quantity by one law.

    Attributes:
        value: By row, in the unit of the quantity.
        valid: Where the law holds.
        range: Where that is, in words.
        two_sets: Whether the law has a curve set for each burst.
    """

    value: Float[np.ndarray, " row"]
    valid: Bool[np.ndarray, " row"]
    range: str
    two_sets: bool


Calculation = Mapping[str, Mapping[str, Calculated]]
"""By quantity and law name."""


def calculated_laws(quantity: str = "") -> tuple[Law, ...]:
    """Return the laws that need a range alone: no time, direction or vehicle.

    Args:
        quantity: Of this one alone; "" for all.
    """
    return tuple(
        law
        for law in LAWS.values()
        if not NEEDS_MORE & set(law.arguments()) and quantity in ("", law.quantity)
    )


def calculate(
    scene: Scene,
    slant_range: Float[ArrayLike, "..."] | Sequence[float],
    charge_mass: Float[ArrayLike, "..."] | Sequence[float],
) -> dict[str, dict[str, Calculated]]:
    """Return every quantity by every law at some ranges from some charges.

    Quantities come in the order of `quantities.py`, unknown ones last.

    Args:
        scene: Charge, air and ground; the mass of its charge is not used.
        slant_range: Distances from the charge [m], positive: one, or a row each.
        charge_mass: Masses of the explosive [kg], positive: one, or a row each.

    Returns:
        By quantity and law: the value at each row, and whether the law holds there.

    Raises:
        InputError: There are neither as many ranges as masses, nor one of either.

    Example:
        `jblast.calculate(jblast.Scene(), [20.0, 40.0], 15.0)["peak_overpressure_pa"]`
    """
    given = [np.atleast_1d(np.asarray(x, float)) for x in (slant_range, charge_mass)]
    for name, one in zip(("slant_range", "charge_mass"), given, strict=True):
        if one.ndim > 1:
            raise InputError(f"{name}: expected one number or a row, got {one.shape}")
    if len({one.size for one in given} - {1}) > 1:
        raise InputError(
            f"charge_mass: expected shape {given[0].shape}, as slant_range has, or "
            f"one number; got {given[1].shape}"
        )
    slant_range, charge_mass = np.broadcast_arrays(*given)
    laws = {(law.quantity, law.name): law for law in calculated_laws()}
    values, valid = evaluate(scene, slant_range, charge_mass, tuple(laws.values()))
    order = {name: i for i, name in enumerate((*QUANTITIES, *DERIVED_QUANTITIES))}
    rows = enumerate((*laws, *combined_of(laws)))
    answer: dict[str, dict[str, Calculated]] = {}
    for i, (quantity, name) in sorted(
        rows, key=lambda row: order.get(row[1][0], len(order))
    ):
        law = laws.get((quantity, name))
        if law is None:
            combination = COMBINATIONS[quantity]
            law = laws[combination.parts[0], name]
            law = replace(law, range=combination.range)
        two_sets = "burst" in law.arguments()
        of_law = Calculated(values[i], valid[i], law.range, two_sets)
        answer.setdefault(quantity, {})[name] = of_law
    return answer


def only(answer: Calculation, quantity: str = "", law: str = "") -> Calculation:
    """Return one quantity or law of a calculation; "" leaves quantity or law open.

    Quantities that the law does not give are left out.
    """
    selected = {
        name: {of: one for of, one in by_law.items() if law in ("", of)}
        for name, by_law in answer.items()
        if quantity in ("", name)
    }
    return {name: by_law for name, by_law in selected.items() if by_law}


def with_other_burst(scene: Scene) -> Scene:
    """Return the scene with the other of the two curve sets."""
    other: Burst = "surface" if scene.charge.burst == "free-air" else "free-air"
    charge = replace(scene.charge, burst=other)
    return replace(scene, charge=charge)


def evaluate(
    scene: Scene,
    slant_range: Float[np.ndarray, " row"],
    charge_mass: Float[np.ndarray, " row"],
    laws: tuple[Law, ...],
) -> tuple[Float[np.ndarray, "law row"], Bool[np.ndarray, "law row"]]:
    """Return values and validity of some laws, then of what they give together."""
    charge = scene.charge
    if charge.burst is None and not float(charge.up) > 0.0:  # half of the program
        scene = replace(scene, charge=replace(charge, burst="surface", by_height=True))
    n = len(slant_range)
    padding = (0, max(FEWEST_ROWS, 1 << (n - 1).bit_length()) - n)
    ranges, masses = (
        as_float_array(np.pad(x, padding, mode="edge"))
        for x in (slant_range, charge_mass)
    )
    values, valid = _evaluate(scene, ranges, masses, laws)
    return np.asarray(values)[:, :n], np.asarray(valid)[:, :n]


@kept
def _evaluate(
    scene: Scene,
    slant_range: Float[Array, " row"],
    charge_mass: Float[Array, " row"],
    laws: tuple[Law, ...],
) -> tuple[Float[Array, "law row"], Bool[Array, "law row"]]:
    """Evaluate all laws at once: one compilation, kept between runs."""
    path = scene_path(scene)
    values, valid = {}, {}
    for law in laws:
        mass = scene.charge.tnt_factor_for(law.quantity) * charge_mass
        way = with_rows(path, slant_range, mass)
        key = law.quantity, law.name
        values[key] = jnp.broadcast_to(call(law.function, way), slant_range.shape)
        valid[key] = jnp.broadcast_to(call(law.valid, way), slant_range.shape)
    for quantity, name in combined_of(values):
        combination = COMBINATIONS[quantity]
        parts = [(part, name) for part in combination.parts]
        value = combination.function(*(values[part] for part in parts))
        values[quantity, name] = value
        holds = [combination.holds(value), *(valid[part] for part in parts)]
        valid[quantity, name] = jnp.stack(holds).all(axis=0)
    return jnp.stack(list(values.values())), jnp.stack(list(valid.values()))


@dataclass(frozen=True)
class Combination:
    """A quantity that is calculated from others.

    Attributes:
        parts: The others.
        function: Of their values, in that order.
        holds: Where it makes sense, of its own value.
        range: Where it holds, in words.
    """

    parts: tuple[str, ...]
    function: Callable[..., Any]
    holds: Callable[[Any], Any]
    range: str


COMBINATIONS = {
    "arrival_difference_s": Combination(
        parts=tuple(part for part, _ in components("arrival_difference_s")),
        function=lambda air, ground: air - ground,
        holds=lambda difference: difference > 0.0,
        range="where both of its arrivals hold and the air's is the later",
    ),
    "friedlander_decay": Combination(
        parts=("peak_overpressure_pa", "positive_impulse_pa_s", "positive_duration_s"),
        function=friedlander_decay,
        # below -1 the three do not belong to one Friedlander pulse
        holds=lambda decay: decay > -1.0,
        range="where its pressure, impulse and duration hold, and b > -1",
    ),
}


def combined_of(known: Iterable[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
    """Return the combinations whose parts are known, each under the parts' law name.

    Args:
        known: Pairs of quantity and law name.
    """
    known = tuple(known)
    names = dict.fromkeys(name for _, name in known)
    return tuple(
        (quantity, name)
        for quantity, combination in COMBINATIONS.items()
        for name in names
        if all((part, name) in known for part in combination.parts)
    )


@dataclass(frozen=True)
class Roots:
    """Ranges or masses at which one law gives the value.

    Attributes:
        law: The law.
        value: Ranges [m] or masses of the explosive [kg], ascending.
        valid: Whether the law holds there, outside the charge.
        attained: Least and largest value of the law where it holds; None where it
            holds nowhere.
    """

    law: Law
    value: Float[np.ndarray, " root"]
    valid: Bool[np.ndarray, " root"]
    attained: tuple[float, float] | None

    def best(self) -> tuple[float, bool] | None:
        """Return the first valid root, else the first, and whether it is valid."""
        if not len(self.value):
            return None
        first = int(np.argmax(self.valid))  # 0 where none is
        return float(self.value[first]), bool(self.valid[first])


def roots(question: Question) -> dict[str, Roots]:
    """Return by law where the quantity asked about takes its value.

    Args:
        question: With a quantity, its target, and either one range or one mass.
    """
    laws = calculated_laws(question.quantity)
    log_x = np.log(_grid(question))
    value, valid = _along(question, log_x, laws)
    above = value >= question.target
    law, left = np.nonzero(above[:, 1:] != above[:, :-1])
    low, high = log_x[left], log_x[left + 1]
    start = above[law, left]
    for _ in range(BISECTIONS if len(law) else 0):
        middle = 0.5 * (low + high)
        now = _along(question, middle, laws)[0][law, np.arange(len(law))]
        same = (now >= question.target) == start
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    found = 0.5 * (low + high)
    holds = _along(question, found, laws)[1] if len(law) else np.zeros((len(laws), 0))
    return {
        one.name: Roots(
            law=one,
            value=np.exp(found[law == i]),
            valid=holds[i, law == i].astype(bool),
            attained=_span(value[i, valid[i]]),
        )
        for i, one in enumerate(laws)
    }


def _grid(question: Question) -> Float[np.ndarray, " point"]:
    """Return ranges or masses of the explosive to look at, ascending."""
    factor = float(question.scene.charge.tnt_factor_for(question.quantity))
    pressure = scene_path(question.scene).ambient_pressure.item()
    scale = factor * STANDARD_PRESSURE / pressure
    if question.charge_mass:
        return SCALED_DISTANCES * np.cbrt(scale * question.charge_mass[0])
    return (question.slant_range[0] / SCALED_DISTANCES[::-1]) ** 3 / scale


def _along(
    question: Question, log_x: Float[np.ndarray, " point"], laws: tuple[Law, ...]
) -> tuple[Float[np.ndarray, "law point"], Bool[np.ndarray, "law point"]]:
    """Return the laws, and where they hold, along what is asked for."""
    x = np.exp(log_x)
    if question.charge_mass:
        slant_range, mass = x, np.full_like(x, question.charge_mass[0])
    else:
        slant_range, mass = np.full_like(x, question.slant_range[0]), x
    value, valid = evaluate(question.scene, slant_range, mass, laws)
    return value, valid & (slant_range > charge_radius(mass))


def _span(values: Float[np.ndarray, " point"]) -> tuple[float, float] | None:
    return (float(values.min()), float(values.max())) if len(values) else None


@dataclass(frozen=True)
class Recommended:
    """One answer to one question.

    Attributes:
        quantity: The answer's: a quantity, `range_m` or `charge_mass_kg`.
        law: By which law; "" where none gives it.
        value: In SI.
        valid: Whether the law holds there.
        scatter: One standard deviation of nature about it, in ln of the answer; NaN
            where it is unknown.
        choice: By which it was taken; None where there is no other law, and where none
            was chosen.
        is_nearest: Whether the chosen law does not give the value: then it is the
            nearest to the others of those that give it where they hold.
        solutions: Of a range or a mass: every one at which the law takes the value
            within its range, ascending; `value` is one of them. Absent of a quantity.
    """

    quantity: str
    law: str
    value: float
    valid: bool
    scatter: float
    choice: "Choice | None" = field(default=None, metadata=HIDDEN)
    is_nearest: bool = field(default=False, metadata=HIDDEN)
    solutions: tuple[float, ...] | None = field(default=None, metadata=ABSENT)


def choice_at(question: Question, quantity: str) -> "Choice":
    """Return what `auto` chooses of a quantity at a question's one row.

    The best one, without a tolerance.
    """
    from jblast.fidelity import choose_for
    from jblast.fidelity.errors import jitted_conditions

    path = path_of_rows(question, quantity)
    if path.burst is None:
        burst = "free-air" if bool(np.asarray(path.free_air)[0]) else "surface"
        path = path.at_burst(burst)
    conditions = jax.tree.map(np.asarray, jitted_conditions(quantity, path))
    return choose_for(quantity, [conditions], 0.0)


def recommended_value(
    question: Question, quantity: str, by_law: Mapping[str, Calculated]
) -> Recommended:
    """Return the answer to a question of one range, one mass and one quantity.

    Args:
        question: One range and one mass.
        quantity: Of the answer.
        by_law: Its values by the laws.
    """
    law, choice = _law_for(question, quantity, tuple(by_law))
    found = by_law[law]
    return Recommended(
        quantity=quantity,
        law=law,
        value=float(found.value[0]),
        valid=bool(found.valid[0]),
        scatter=law_scatter(question, quantity, law),
        choice=choice,
    )


def recommended_root(question: Question, by_law: Mapping[str, Roots]) -> Recommended:
    """Return the range or mass at which a quantity takes its value.

    The law is chosen at the median of the laws that hold. If the chosen law does not
    give the value within its range, the nearest to the median that does is taken.

    Args:
        question: Of a quantity, its target, and one range or one mass.
        by_law: From `roots`.
    """
    asked = "range_m" if question.charge_mass else "charge_mass_kg"
    best = {name: found.best() for name, found in by_law.items()}
    best = {name: root for name, root in best.items() if root is not None}
    holding = {name: value for name, (value, valid) in best.items() if valid}
    if not holding:
        return Recommended(asked, "", math.nan, False, math.nan, solutions=())
    middle = math.exp(float(np.median(np.log(list(holding.values())))))
    law, choice = _law_for(_at(question, middle), question.quantity, tuple(by_law))
    is_nearest = law not in holding
    if is_nearest:
        law = min(holding, key=lambda name: abs(math.log(holding[name] / middle)))
    value = holding[law]
    scatter = law_scatter(_at(question, value), question.quantity, law)
    slope = _slope(question, value, law)
    return Recommended(
        quantity=asked,
        law=law,
        value=value,
        valid=True,
        scatter=scatter / abs(slope) if slope else math.nan,
        solutions=tuple(map(float, by_law[law].value[by_law[law].valid])),
        choice=None if is_nearest else choice,
        is_nearest=is_nearest,
    )


def law_scatter(question: Question, quantity: str, law: str) -> float:
    """Return one standard deviation of nature about a law, in ln, at a question's row.

    NaN of what is combined of several laws.
    """
    if (quantity, law) not in LAWS:
        return math.nan
    sd = total_scatter(LAWS[quantity, law], path_of_rows(question, quantity))
    return float(np.ravel(np.asarray(sd))[0])


def _law_for(
    question: Question, quantity: str, names: tuple[str, ...]
) -> "tuple[str, Choice | None]":
    """Return which of some laws is taken, and what it was chosen by."""
    if len(names) == 1:
        return names[0], None
    parts = COMBINATIONS[quantity].parts if quantity in COMBINATIONS else (quantity,)
    for part in parts:
        if names_for(part):
            choice = choice_at(question, part)
            if choice.method in names:
                return choice.method, choice
    return names[0], None


def _at(question: Question, value: float) -> Question:
    """Return a question with the range or the mass that it asks for put in."""
    if question.charge_mass:
        return replace(question, slant_range=(value,))
    return replace(question, charge_mass=(value,))


def _slope(question: Question, value: float, law: str) -> float:
    """Return the slope of ln quantity against ln of what is asked for."""
    values = value * np.exp([-STEP, STEP])
    if question.charge_mass:
        ranges, masses = values, np.full(2, question.charge_mass[0])
    else:
        ranges, masses = np.full(2, question.slant_range[0]), values
    found, _ = evaluate(question.scene, ranges, masses, (LAWS[question.quantity, law],))
    low, high = np.log(found[0])
    return float((high - low) / (2.0 * STEP))


@dataclass(frozen=True)
class Disagreement:
    """Two laws of one quantity that hold at a place and contradict each other there.

    Attributes:
        quantity: Of which.
        low: Law of the smaller value, where they are furthest apart.
        high: Law of the larger one.
        ratio: Larger over smaller value there.
        expected: Ratio that their scatter leaves, in 90 % of blasts.
        range_m: Range there.
        mass_kg: Mass there.
        rows: At how many rows any two laws disagree.
        choice: Recommended law there; None if there is no reference.
    """

    quantity: str
    low: str
    high: str
    ratio: float
    expected: float
    range_m: float
    mass_kg: float
    rows: int
    choice: "Choice | None" = field(metadata=HIDDEN)


def disagreements(question: Question, answer: Calculation) -> list[Disagreement]:
    """Return the quantities of a calculation of which laws that hold disagree."""
    paths: dict[float, Path] = {}  # pressures and impulses may have a TNT mass each
    found = []
    for name, by_law in answer.items():
        laws = [law for law in by_law if (name, law) in LAWS]
        laws = [law for law in laws if by_law[law].valid.any()]
        if len(laws) < 2:
            continue
        factor = float(question.scene.charge.tnt_factor_for(name))
        if factor not in paths:
            paths[factor] = path_of_rows(question, name)
        found.append(_disagreement_of(question, paths[factor], name, by_law, laws))
    return [one for one in found if one is not None]


def _disagreement_of(
    question: Question,
    path: Path,
    quantity: str,
    by_law: Mapping[str, Calculated],
    names: list[str],
) -> Disagreement | None:
    """Return where some laws of a quantity are furthest apart, if they disagree."""
    scatter = {name: _scatter(quantity, name, path) for name in names}
    apart = {
        pair: _sds_apart([by_law[n] for n in pair], [scatter[n] for n in pair])
        for pair in combinations(names, 2)
    }
    sds = np.array(list(apart.values()))
    if not sds.max() > BEYOND:
        return None
    which, row = np.unravel_index(int(sds.argmax()), sds.shape)
    pair = list(apart)[which]
    low, high = sorted(pair, key=lambda name: by_law[name].value[row])
    ratio = float(by_law[high].value[row] / by_law[low].value[row])
    ranges, masses = question.rows()
    return Disagreement(
        quantity=quantity,
        low=low,
        high=high,
        ratio=ratio,
        expected=math.exp(BEYOND * math.hypot(*(scatter[n][row] for n in pair))),
        range_m=float(ranges[row]),
        mass_kg=float(masses[row]),
        rows=int((sds > BEYOND).any(axis=0).sum()),
        choice=_choice(question, quantity, int(row)),
    )


def _scatter(quantity: str, name: str, path: Path) -> Float[np.ndarray, " row"]:
    """Return one standard deviation of nature about a law, in ln, of each row."""
    sd = np.asarray(total_scatter(LAWS[quantity, name], path))
    return np.broadcast_to(sd, path.slant_range.shape)


def _sds_apart(
    pair: list[Calculated], scatter: list[Float[np.ndarray, " row"]]
) -> Float[np.ndarray, " row"]:
    """Return how far apart two laws are, in standard deviations; 0 where one ends."""
    one, other = pair
    both: Bool[np.ndarray, " row"] = one.valid & other.valid
    both &= (one.value > 0.0) & (other.value > 0.0)
    off = np.log(np.where(both, one.value, 1.0) / np.where(both, other.value, 1.0))
    sd = np.hypot(*scatter)
    return np.where(sd > 0.0, np.abs(off) / np.where(sd > 0.0, sd, 1.0), 0.0)


def _choice(question: Question, quantity: str, row: int) -> "Choice | None":
    """Return the choice of `jblast choose` at a row, without a tolerance."""
    from jblast.fidelity.errors import REFERENCES  # read only where laws disagree

    if quantity not in REFERENCES:
        return None
    ranges, masses = question.rows()
    here = replace(
        question,
        slant_range=(float(ranges[row]),),
        charge_mass=(float(masses[row]),),
    )
    return choice_at(here, quantity)
