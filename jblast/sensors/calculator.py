r"""Every quantity at a range by every law, and the range or mass that gives a value.

A question states masses, ranges and conditions. `calculate` evaluates all laws that
need only a range, and the quantities that combine several laws (`combined_of`).

The inverse, `roots`, returns all ranges or masses at which each law takes a value. A
law need not fall with distance: blends of printed fits may have bumps, and the duration
turns back near the charge. The sign of law minus value is therefore evaluated on an
even grid in $\ln Z$ with a step of 0.4 %, and each change of sign is bisected to
rounding error. Two roots within one step are not found.

One answer is recommended: that of the law that `auto` chooses, with the law's scatter.
For a root the scatter is divided by the slope of the law. Valid laws that differ by
more than their scatter (90 %) are reported as a disagreement.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
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
from jblast.waves.height_of_burst import free_air_weight, grounded
from jblast.waves.paths import Path
from jblast.waves.waveform import friedlander_decay

if TYPE_CHECKING:  # the tables of `fidelity` are read only where a law is recommended
    from jblast.fidelity import Choice
    from jblast.fidelity.errors import Conditions

NEEDS_MORE = {"time_since_detonation", "toward_east", "jolt"}
"""Arguments that a question does not state: laws with one of them are left out."""
FEWEST_ROWS = 64
"""Rows are padded to a power of two from here on, so few shapes are compiled. A smaller
first size compiles more programs; a larger one evaluates padding for one row."""
SCALED_DISTANCES = np.geomspace(1e-2, 1e5, 4096)
"""Scaled distances of the search for roots [m/kg^(1/3)]: from inside the charge (its
surface is at 0.05) to past every law. 4096 points are 0.4 % apart; fewer
would miss more pairs of roots."""
BISECTIONS = 48
"""Halvings of a grid step of 0.4 %: to 1e-17 in ln, below rounding error."""
STEP = 1e-3
"""Half width of the central difference for a law's slope, in ln of a range or mass. The
error of curvature (1e-6) and that of rounding (1e-13) are both negligible."""
BEYOND = 1.645
"""Standard deviations of the difference of two laws that contain 90 % of it (normal
quantile of 95 %). A larger difference is reported as a disagreement."""


@dataclass(frozen=True)
class Question:
    """One question to the laws.

    Attributes:
        scene: Charge, air and ground; the mass of its charge is not used.
        slant_range: Distances from the charge [m]; empty if they are unknown.
        charge_mass: Masses of the explosive [kg]; empty if they are unknown.
        quantity: Measured quantity that replaces the unknown; "" if none.
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

    @property
    def unknown(self) -> Literal["", "range_m", "charge_mass_kg"]:
        """Name of the unknown; "" if ranges and masses are given."""
        if not self.quantity:
            return ""
        return "range_m" if self.charge_mass else "charge_mass_kg"

    def rows(self) -> tuple[np.ndarray, np.ndarray]:
        """Return ranges and masses of all combinations; ranges vary fastest."""
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

    The ambient air of this path is that of every sensor.
    """
    # the range of 1 m is a placeholder: `with_rows` replaces it
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
    """Return a path with given ranges and TNT masses; both ranges are the slant range.

    If the height of burst leaves the curve set open, each sensor is as low as its
    range allows.

    Args:
        path: From `scene_path`.
        slant_range: Distances [m].
        charge_mass: TNT-equivalent masses [kg].
    """
    free_air = path.free_air
    if path.burst is None:
        ranges = jnp.asarray(slant_range)
        free_air = free_air_weight(
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
    # TNT equivalence differs between pressure and impulse, so each quantity has its own
    # mass
    factor = float(question.scene.charge.tnt_factor_for(quantity))
    path = scene_path(question.scene)
    return with_rows(path, as_float_array(ranges), as_float_array(factor * masses))


def free_air_weights(question: Question) -> Float[np.ndarray, " row"]:
    """Return the weight of the free-air curves in each row.

    A sensor is as low as its range allows: on the ground, unless the charge is higher
    than the range is long.
    """
    ranges, _ = question.rows()
    charge = question.scene.charge
    # an unknown range or mass leaves the height question open, and on the ground no
    # reflection is separate
    if question.quantity or not float(charge.up) > 0.0:
        return np.zeros(ranges.shape)
    # with no curve set stated, the path weighs both by its height
    scene = replace(question.scene, charges=(replace(charge, burst=None),))
    rows = path_of_rows(replace(question, scene=scene))
    return np.broadcast_to(rows.free_air, ranges.shape)


def with_burst(question: Question) -> Question:
    """Return the question with surface curves on the ground and for unknown ranges.

    A stated curve set stays.
    """
    scene = grounded(question.scene)
    charge = scene.charge
    if charge.burst is None and question.quantity:
        scene = replace(scene, charges=(replace(charge, burst="surface"),))
    return replace(question, scene=scene)


@dataclass(frozen=True)
class Calculated:
    """One quantity by one law.

    Attributes:
        value: By row, in the unit of the quantity.
        valid: Mask of the rows within the law's range of validity.
        range: Range of validity, as text.
        two_sets: True if the law has a curve set for each burst.
    """

    value: Float[np.ndarray, " row"]
    valid: Bool[np.ndarray, " row"]
    range: str
    two_sets: bool


Calculation = Mapping[str, Mapping[str, Calculated]]
"""Calculated values by quantity and law name."""


def calculated_laws(quantity: str = "") -> tuple[Law, ...]:
    """Return the laws that need only a range: no time, direction or vehicle.

    Args:
        quantity: Return laws of this quantity only; "" for all.
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
    """Return every quantity by every law at given ranges from given charges.

    Quantities come in the order of `quantities.py`, unknown ones last.

    Args:
        scene: Charge, air and ground; the mass of its charge is not used.
        slant_range: Distances from the charge [m], positive: a number, or one per row.
        charge_mass: Masses of the explosive [kg], positive: a number, or one per row.

    Returns:
        Value and validity at each row, by quantity and law.

    Raises:
        InputError: The numbers of ranges and masses differ, and neither is one.

    Example:
        `jblast.calculate(jblast.Scene(), [20.0, 40.0], 15.0)["peak_overpressure_pa"]`
    """
    given = [np.atleast_1d(np.asarray(x, float)) for x in (slant_range, charge_mass)]
    for name, one in zip(("slant_range", "charge_mass"), given, strict=True):
        if one.ndim > 1:
            raise InputError(f"{name}: expected one number or a row, got {one.shape}")
    # a single number is broadcast against the rows of the other
    if len({one.size for one in given} - {1}) > 1:
        raise InputError(
            f"charge_mass: expected one number or shape {given[0].shape}, as "
            f"slant_range has; got {given[1].shape}"
        )
    slant_range, charge_mass = np.broadcast_arrays(*given)
    laws = {(law.quantity, law.name): law for law in calculated_laws()}
    values, valid = evaluate(scene, slant_range, charge_mass, tuple(laws.values()))
    # the table of quantities defines the order of all reports
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
    """Return one quantity or law of a calculation; "" selects all of them.

    Quantities that the law does not predict are left out.
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
    return replace(scene, charges=(charge,))


def evaluate(
    scene: Scene,
    slant_range: Float[np.ndarray, " row"],
    charge_mass: Float[np.ndarray, " row"],
    laws: tuple[Law, ...],
) -> tuple[Float[np.ndarray, "law row"], Bool[np.ndarray, "law row"]]:
    """Return values and validity of laws, then of the combinations of these laws."""
    scene = grounded(scene)
    n = len(slant_range)
    values, valid = _evaluate(scene, _padded(slant_range), _padded(charge_mass), laws)
    return np.asarray(values)[:, :n], np.asarray(valid)[:, :n]


def _padded(x: Float[np.ndarray, " row"]) -> Float[Array, " padded"]:
    """Return rows padded to a power of two, so that few shapes are compiled."""
    padding = (0, max(FEWEST_ROWS, 1 << (len(x) - 1).bit_length()) - len(x))
    # edge values, not zeros: padded rows stay within the laws' domains
    return as_float_array(np.pad(x, padding, mode="edge"))


@kept
def _evaluate(
    scene: Scene,
    slant_range: Float[Array, " row"],
    charge_mass: Float[Array, " row"],
    laws: tuple[Law, ...],
) -> tuple[Float[Array, "law row"], Bool[Array, "law row"]]:
    """Evaluate all laws in one program, whose compilation is kept between runs."""
    path = scene_path(scene)
    values, valid = {}, {}
    for law in laws:
        mass = scene.charge.tnt_factor_for(law.quantity) * charge_mass
        row_path = with_rows(path, slant_range, mass)
        key = law.quantity, law.name
        values[key] = jnp.broadcast_to(call(law.function, row_path), slant_range.shape)
        valid[key] = jnp.broadcast_to(call(law.valid, row_path), slant_range.shape)
    for quantity, name in combined_of(values):
        combination = COMBINATIONS[quantity]
        parts = [(part, name) for part in combination.parts]
        value = combination.function(*(values[part] for part in parts))
        values[quantity, name] = value
        holds = [combination.holds(value), *(valid[part] for part in parts)]
        # a combination holds only where all of its parts do
        valid[quantity, name] = jnp.stack(holds).all(axis=0)
    return jnp.stack(list(values.values())), jnp.stack(list(valid.values()))


@dataclass(frozen=True)
class Combination:
    """A quantity that is calculated from other quantities.

    Attributes:
        parts: Quantities that it is calculated from.
        function: Function of their values, in that order.
        holds: Predicate of the combined value: True if it is meaningful.
        range: Range of validity, as text.
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
        # no Friedlander pulse with b <= -1 has this peak, impulse and duration
        holds=lambda decay: decay > -1.0,
        range="where its pressure, impulse and duration hold, and b > -1",
    ),
}


def combined_of(known: Iterable[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
    """Return the combinations of known parts, each under the law name of its parts.

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
        valid: Mask of the roots that are within the law's range, outside the charge.
        attained: Smallest and largest value of the law within its range; None if it
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
        first = int(np.argmax(self.valid))  # argmax is 0 if no root is valid
        return float(self.value[first]), bool(self.valid[first])


def roots(question: Question) -> dict[str, Roots]:
    """Return the ranges or masses at which a quantity takes its value, by law.

    Args:
        question: States a quantity, its target, and either one range or one mass.
    """
    laws = calculated_laws(question.quantity)
    log_x = np.log(_grid(question))
    value, valid = _along(question, log_x, laws)
    # NaN compares false, so an undefined interval has no root inside it
    above = value >= question.target
    law, left = np.nonzero(above[:, 1:] != above[:, :-1])
    # all changes of sign of all laws are bisected together: 48 evaluations in total
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
    """Return ranges or masses of the explosive to search, ascending."""
    factor = float(question.scene.charge.tnt_factor_for(question.quantity))
    pressure = scene_path(question.scene).ambient_pressure.item()
    # Sachs scaling: Z of the ambient pressure, not of the standard one
    scale = factor * STANDARD_PRESSURE / pressure
    if question.charge_mass:
        return SCALED_DISTANCES * np.cbrt(scale * question.charge_mass[0])
    return (question.slant_range[0] / SCALED_DISTANCES[::-1]) ** 3 / scale


def _along(
    question: Question, log_x: Float[np.ndarray, " point"], laws: tuple[Law, ...]
) -> tuple[Float[np.ndarray, "law point"], Bool[np.ndarray, "law point"]]:
    """Return laws and their validity at values exp(log_x) of the unknown."""
    slant_range, mass = _rows_at(question, np.exp(log_x))
    value, valid = evaluate(question.scene, slant_range, mass, laws)
    # inside the charge a law may be defined, but no sensor can be there
    return value, valid & (slant_range > charge_radius(mass))


def _rows_at(
    question: Question, x: Float[np.ndarray, " point"]
) -> tuple[Float[np.ndarray, " point"], Float[np.ndarray, " point"]]:
    """Return ranges and masses of the explosive at values x of the unknown."""
    if question.charge_mass:
        return x, np.full_like(x, question.charge_mass[0])
    return np.full_like(x, question.slant_range[0]), x


def _span(values: Float[np.ndarray, " point"]) -> tuple[float, float] | None:
    return (float(values.min()), float(values.max())) if len(values) else None


@dataclass(frozen=True)
class Recommended:
    """Recommended answer to one question.

    Attributes:
        quantity: Name of the answer: a quantity, `range_m` or `charge_mass_kg`.
        law: Name of the law; "" if no law gives an answer.
        value: Answer in SI.
        valid: True if the law holds there.
        scatter: Standard deviation of nature about the answer, in ln; NaN if unknown.
        choice: Basis of the choice of law; None if there is no other law, or no choice
            was made.
        is_nearest: True if the chosen law does not take the value. The answer is then
            that of the valid law nearest to the median.
        solutions: For a range or a mass: all values within the law's range at which it
            takes the target, ascending; `value` is one of them. Absent for a quantity.
    """

    quantity: str
    law: str
    value: float
    valid: bool
    scatter: float
    choice: "Choice | None" = field(default=None, metadata=HIDDEN)
    is_nearest: bool = field(default=False, metadata=HIDDEN)
    solutions: tuple[float, ...] | None = field(default=None, metadata=ABSENT)


def choices_at(question: Question, quantities: Iterable[str]) -> "dict[str, Choice]":
    """Return the choice of `auto` for some quantities at a question's single row.

    The best law is chosen, without a tolerance.
    """
    from jblast.fidelity import choose_for

    by_factor: dict[float, Path] = {}  # TNT factors of pressures and impulses differ
    paths = {}
    for quantity in quantities:
        factor = float(question.scene.charge.tnt_factor_for(quantity))
        if factor not in by_factor:
            path = path_of_rows(question, quantity)
            if path.burst is None:
                burst = (
                    "free-air"
                    if float(np.asarray(path.free_air)[0]) >= 1.0
                    else "surface"
                )
                path = replace(path, burst=burst)
            by_factor[factor] = path
        paths[quantity] = by_factor[factor]
    conditions = jax.tree.map(np.asarray, _conditions(paths)) if paths else {}
    return {name: choose_for(name, [one], 0.0) for name, one in conditions.items()}


# One program for all quantities: to load one takes 40 ms, and `jblast calc` needs a
# dozen choices.
@kept
def _conditions(paths: dict[str, Path]) -> "dict[str, Conditions]":
    from jblast.fidelity.errors import conditions_of

    return {quantity: conditions_of(quantity, path) for quantity, path in paths.items()}


def recommended_values(
    question: Question, answer: Calculation
) -> dict[str, Recommended]:
    """Return the recommended value of each quantity of an answer.

    Args:
        question: One range and one mass.
        answer: Values of the laws, by quantity.
    """
    choices = choices_at(question, compared_quantities(answer))
    taken = {
        quantity: _law_of(quantity, tuple(by_law), choices)
        for quantity, by_law in answer.items()
    }
    scatter = law_scatters(question, _laws_of(answer))
    return {
        quantity: Recommended(
            quantity=quantity,
            law=law,
            value=float(answer[quantity][law].value[0]),
            valid=bool(answer[quantity][law].valid[0]),
            # NaN for combinations of several laws
            scatter=float(scatter[quantity, law][0])
            if (quantity, law) in scatter
            else math.nan,
            choice=choice,
        )
        for quantity, (law, choice) in taken.items()
    }


def recommended_by_row(
    question: Question, answer: Calculation, most: int | None = None
) -> list[dict[str, Recommended]]:
    """Return the recommended values at each range and mass of a question.

    Args:
        question: Ranges and masses.
        answer: Values of the laws at its rows.
        most: Largest number of rows, the first ones; None for all.
    """
    found = []
    rows = [*zip(*question.rows(), strict=True)][:most]
    for row, (slant_range, mass) in enumerate(rows):
        one = replace(
            question, slant_range=(float(slant_range),), charge_mass=(float(mass),)
        )
        here = {
            quantity: {
                name: replace(
                    of_law, value=of_law.value[[row]], valid=of_law.valid[[row]]
                )
                for name, of_law in by_law.items()
            }
            for quantity, by_law in answer.items()
        }
        found.append(recommended_values(one, here))
    return found


def compared_quantities(answer: Mapping[str, Collection[str]]) -> list[str]:
    """Return the quantities whose laws are compared to recommend one for an answer."""
    parts = [
        part
        for quantity, by_law in answer.items()
        if len(by_law) > 1
        for part in _parts(quantity)
    ]
    return [part for part in dict.fromkeys(parts) if names_for(part)]


def recommended_root(question: Question, by_law: Mapping[str, Roots]) -> Recommended:
    """Return the range or mass at which a quantity takes its value.

    The law is chosen at the median root of the laws that hold. If the chosen law does
    not take the value within its range, the law with the root nearest to the median is
    used.

    Args:
        question: States a quantity, its target, and one range or one mass.
        by_law: From `roots`.
    """
    best = {name: found.best() for name, found in by_law.items()}
    best = {name: root for name, root in best.items() if root is not None}
    holding = {name: value for name, (value, valid) in best.items() if valid}
    if not holding:
        return Recommended(
            question.unknown, "", math.nan, False, math.nan, solutions=()
        )
    # median of logarithms: one outlying law does not decide where laws are compared
    middle = math.exp(float(np.median(np.log(list(holding.values())))))
    named = {question.quantity: tuple(by_law)}
    choices = choices_at(_at(question, middle), compared_quantities(named))
    law, choice = _law_of(question.quantity, tuple(by_law), choices)
    is_nearest = law not in holding
    if is_nearest:
        law = min(holding, key=lambda name: abs(math.log(holding[name] / middle)))
    # the scatter belongs to the answer's own row, not to the median at which the law
    # was chosen
    value = holding[law]
    key = question.quantity, law
    scatter = float(law_scatters(_at(question, value), [key])[key][0])
    slope = _slope(question, value, law)
    return Recommended(
        quantity=question.unknown,
        law=law,
        value=value,
        valid=True,
        scatter=scatter / abs(slope) if slope else math.nan,
        solutions=tuple(map(float, by_law[law].value[by_law[law].valid])),
        choice=None if is_nearest else choice,
        is_nearest=is_nearest,
    )


def law_scatters(
    question: Question, laws: Iterable[tuple[str, str]]
) -> dict[tuple[str, str], Float[np.ndarray, " row"]]:
    """Return the standard deviation of blasts about laws, in ln, at each row.

    Args:
        question: Ranges and masses.
        laws: Quantity and name of each law.
    """
    keys = tuple(laws)
    if not keys:
        return {}
    rows = question.rows()
    scene, (ranges, masses) = question.scene, map(_padded, rows)
    found = np.asarray(_scatters(scene, ranges, masses, tuple(LAWS[k] for k in keys)))
    return dict(zip(keys, found[:, : len(rows[0])], strict=True))


@kept
def _scatters(
    scene: Scene,
    slant_range: Float[Array, " row"],
    charge_mass: Float[Array, " row"],
    laws: tuple[Law, ...],
) -> Float[Array, "law row"]:
    path = scene_path(scene)
    found = []
    for law in laws:
        mass = scene.charge.tnt_factor_for(law.quantity) * charge_mass
        sd = total_scatter(law, with_rows(path, slant_range, mass))
        found.append(jnp.broadcast_to(jnp.asarray(sd, float), slant_range.shape))
    return jnp.stack(found)


def _laws_of(answer: Calculation) -> list[tuple[str, str]]:
    """Return quantity and name of the laws of an answer, without combinations.

    Disagreements and recommended values need the scatter of different laws of it. Both
    evaluate all of them: one program to load.
    """
    keys = [(quantity, name) for quantity, by_law in answer.items() for name in by_law]
    return [key for key in keys if key in LAWS]


def _parts(quantity: str) -> tuple[str, ...]:
    """Return the quantities that a combination is of; any other is its own part."""
    return COMBINATIONS[quantity].parts if quantity in COMBINATIONS else (quantity,)


def _law_of(
    quantity: str, names: tuple[str, ...], choices: "Mapping[str, Choice]"
) -> "tuple[str, Choice | None]":
    """Return the recommended law of those named, and the basis of the choice."""
    first, *others = names
    if others:
        for part in _parts(quantity):
            if part in choices and choices[part].method in names:
                return choices[part].method, choices[part]
    return first, None


def _at(question: Question, value: float) -> Question:
    """Return the question with a value of its unknown range or mass."""
    if question.charge_mass:
        return replace(question, slant_range=(value,))
    return replace(question, charge_mass=(value,))


def _slope(question: Question, value: float, law: str) -> float:
    """Return d ln(quantity) / d ln(unknown) by central differences."""
    ranges, masses = _rows_at(question, value * np.exp([-STEP, STEP]))
    found, _ = evaluate(question.scene, ranges, masses, (LAWS[question.quantity, law],))
    low, high = np.log(found[0])
    return float((high - low) / (2.0 * STEP))


@dataclass(frozen=True)
class Disagreement:
    """Two valid laws of one quantity that differ by more than their scatter.

    Attributes:
        quantity: The quantity.
        low: Law of the smaller value, at the row of the largest difference.
        high: Law of the larger value there.
        ratio: Larger over smaller value there.
        expected: Ratio that the scatter of both allows in 90 % of blasts.
        range_m: Range of that row.
        mass_kg: Mass of that row.
        rows: Number of rows at which any two laws disagree.
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
    """Return one disagreement per quantity whose valid laws disagree."""
    laws = {
        quantity: [
            name
            for name, found in by_law.items()
            if (quantity, name) in LAWS and found.valid.any()
        ]
        for quantity, by_law in answer.items()
    }
    laws = {quantity: names for quantity, names in laws.items() if len(names) > 1}
    if not laws:
        return []
    scatter = law_scatters(question, _laws_of(answer))
    found = [
        _disagreement_of(question, scatter, quantity, answer, names)
        for quantity, names in laws.items()
    ]
    return [one for one in found if one is not None]


def _disagreement_of(
    question: Question,
    scatter: Mapping[tuple[str, str], Float[np.ndarray, " row"]],
    quantity: str,
    answer: Calculation,
    names: list[str],
) -> Disagreement | None:
    """Return the largest difference of the named laws, if it is a disagreement."""
    by_law = answer[quantity]
    apart = {
        pair: _sds_apart(
            [by_law[name] for name in pair], [scatter[quantity, name] for name in pair]
        )
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
        expected=math.exp(
            BEYOND * math.hypot(*(scatter[quantity, n][row] for n in pair))
        ),
        range_m=float(ranges[row]),
        mass_kg=float(masses[row]),
        rows=int((sds > BEYOND).any(axis=0).sum()),
        choice=_choice(question, quantity, answer, int(row)),
    )


def _sds_apart(
    pair: list[Calculated], scatter: list[Float[np.ndarray, " row"]]
) -> Float[np.ndarray, " row"]:
    """Return |ln ratio| of two laws in standard deviations; 0 where one is invalid."""
    one, other = pair
    both: Bool[np.ndarray, " row"] = one.valid & other.valid
    both &= (one.value > 0.0) & (other.value > 0.0)
    off = np.log(np.where(both, one.value, 1.0) / np.where(both, other.value, 1.0))
    # independent scatter of two laws: the variance of their difference is the sum
    sd = np.hypot(*scatter)
    return np.where(sd > 0.0, np.abs(off) / np.where(sd > 0.0, sd, 1.0), 0.0)


def _choice(
    question: Question, quantity: str, answer: Calculation, row: int
) -> "Choice | None":
    """Return the choice of `jblast choose` at a row, without a tolerance."""
    from jblast.fidelity.errors import REFERENCES  # imported only on a disagreement

    if quantity not in REFERENCES:
        return None
    ranges, masses = question.rows()
    here = replace(
        question,
        slant_range=(float(ranges[row]),),
        charge_mass=(float(masses[row]),),
    )
    # all quantities of the answer, as for their recommended values: one program
    return choices_at(here, compared_quantities(answer))[quantity]
