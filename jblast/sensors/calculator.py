r"""Every quantity at a range by every law, and the range or mass that gives a value.

A question states masses, ranges and conditions. `calculate` evaluates all laws that
need only a range, and the quantities that combine several laws (`COMBINATIONS`). All of
it is NumPy: nothing is compiled, and JAX is not imported.

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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any, Literal

import numpy as np

import jblast.waves as _waves  # noqa: F401  laws enter the registry as they are imported
from jblast.constants import TNT_DENSITY
from jblast.errors import require
from jblast.quantities import DERIVED_QUANTITIES, QUANTITIES, components
from jblast.registry import LAWS, Law
from jblast.results import ABSENT, HIDDEN
from jblast.scene import Scene
from jblast.types import ArrayLike, Bool, Float, in_numpy, unconverted
from jblast.waves.choice import Choice, Compared, compared_on, references, tnt_path
from jblast.waves.friedlander import friedlander_decay
from jblast.waves.paths import Evaluated, Path, evaluate
from jblast.waves.scaling import sachs_distance_factor

NEEDS_MORE = {"time_since_detonation", "toward_east", "jolt_east"}
"""Arguments that a question does not state: laws with one of them are left out."""
SCALED_DISTANCES = np.geomspace(1e-2, 1e5, 4096)
"""Scaled distances of the search for roots [m/kg^(1/3)]: from inside the charge (its
surface is at 0.05) to past every law. 4096 points are 0.4 % apart; fewer would miss
more pairs of roots."""
BISECTIONS = 48
"""Halvings of a grid step of 0.4 %: to 1e-17 in ln, below rounding error."""
STEP = 1e-3
"""Half width of the central difference for a law's slope, in ln of a range or mass. The
error of curvature (1e-6) and that of rounding (1e-13) are both negligible."""
BEYOND = 1.645
"""Standard deviations of the difference of two laws that contain 90 % of it (normal
quantile of 95 %). A larger difference is reported as a disagreement."""

Numbers = Float[np.ndarray, " row"]


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

    def rows(self) -> "Rows":
        """Return all combinations of ranges and masses; ranges vary fastest."""
        masses, ranges = np.meshgrid(self.charge_mass, self.slant_range, indexing="ij")
        return Rows(self.scene, ranges.ravel(), masses.ravel())

    def at(self, unknown: ArrayLike) -> "Rows":
        """Return the rows at values of the unknown."""
        x = np.atleast_1d(np.asarray(unknown, float))
        if self.charge_mass:
            return Rows(self.scene, x, np.full_like(x, self.charge_mass[0]))
        return Rows(self.scene, np.full_like(x, self.slant_range[0]), x)


def charge_radius(charge_mass: ArrayLike) -> Float[np.ndarray, "..."]:
    r"""Return the radius of a sphere of TNT [m]: $(3 W / (4 \pi \rho))^{1/3}$.

    Args:
        charge_mass: $W$ [kg].
    """
    volume = np.asarray(charge_mass) / TNT_DENSITY
    return np.asarray(np.cbrt(3.0 * volume / (4.0 * math.pi)))


@dataclass(frozen=True)
class Rows:
    """Ranges and masses, and all laws there, evaluated once for each quantity.

    Attributes:
        scene: Charge, air and ground; the mass of its charge is not used.
        slant_range: Distances [m].
        charge_mass: Masses of the explosive [kg].
        known: Results so far.
    """

    scene: Scene
    slant_range: Numbers
    charge_mass: Numbers
    known: dict[Any, Any] = field(default_factory=dict, repr=False)

    def path(self, quantity: str = "peak_overpressure_pa") -> Path:
        """Return the paths, their masses those of TNT for a quantity.

        A sensor is as low as its range allows: on the ground, unless the charge is
        higher than the range is long.
        """

        def made() -> Path:
            scene, count = in_numpy(self.scene), len(self.slant_range)
            charge = unconverted(scene.charge, mass_kg=self.charge_mass, range_m=None)
            nowhere, never = np.zeros((count, 3)), np.full(count, np.nan)
            return tnt_path(scene, charge, quantity, nowhere, self.slant_range, never)

        # TNT equivalence differs between pressure and impulse
        return self._once(float(self.scene.charge.tnt_factor_for(quantity)), made)

    def evaluated(self, quantity: str) -> Evaluated:
        """Return all laws of a quantity."""
        return self._once(quantity, lambda: evaluate(quantity, self.path(quantity)))

    def compared(self, quantity: str) -> Compared:
        """Return the laws of a quantity with their differences from a reference."""
        given = self.path(quantity), self.evaluated(quantity), quantity
        return self._once(("compared", quantity), lambda: compared_on(*given))

    def _once(self, key: Any, made: Callable[[], Any]) -> Any:
        if key not in self.known:
            self.known[key] = made()
        return self.known[key]


@dataclass(frozen=True)
class Calculated:
    """One quantity by one law.

    Attributes:
        value: By row, in the unit of the quantity.
        valid: Mask of the rows within the law's range of validity.
        range: Range of validity, as text.
        scatter: Standard deviation of real blasts about the value, in ln; NaN for
            combinations of several laws.
    """

    value: Numbers
    valid: Bool[np.ndarray, " row"]
    range: str
    scatter: Numbers


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
    slant_range: ArrayLike | Sequence[float],
    charge_mass: ArrayLike | Sequence[float],
) -> dict[str, dict[str, Calculated]]:
    """Return every quantity by every law at given ranges from given charges.

    Quantities come in the order of `quantities.csv`, unknown ones last.

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
    rows = max(one.size for one in given)
    for name, one in zip(("slant_range", "charge_mass"), given, strict=True):
        expected = f"a number or a row of {rows} numbers"
        # a single number is broadcast against the rows of the other
        require(one.shape in ((1,), (rows,)), name, expected, f"shape {one.shape}")
    ranges, masses = np.broadcast_arrays(*given)
    return calculated(Rows(scene, ranges, masses))


def calculated(rows: Rows) -> dict[str, dict[str, Calculated]]:
    """Return every quantity by every law at given rows."""
    quantities = dict.fromkeys(law.quantity for law in calculated_laws())
    found = {quantity: by_law(rows, quantity) for quantity in quantities}
    found |= {name: _combined(found, of) for name, of in COMBINATIONS.items()}
    # the table of quantities defines the order of all reports
    order = {name: i for i, name in enumerate((*QUANTITIES, *DERIVED_QUANTITIES))}
    ordered = sorted(found, key=lambda name: order.get(name, len(order)))
    return {quantity: found[quantity] for quantity in ordered}


def by_law(rows: Rows, quantity: str) -> dict[str, Calculated]:
    """Return one quantity by every law that needs only a range, at given rows."""
    found = rows.evaluated(quantity)
    return {
        law.name: Calculated(
            value=found.value[i],
            valid=found.valid[i],
            range=law.range,
            scatter=found.sd[i],
        )
        for law in calculated_laws(quantity)
        for i in [found.names.index(law.name)]
    }


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


def _combined(found: Calculation, combination: Combination) -> dict[str, Calculated]:
    """Return a combination by each law that predicts all of its parts."""
    parts = [found[part] for part in combination.parts]
    answer = {}
    for name in [name for name in parts[0] if all(name in one for one in parts)]:
        of_parts = [by_name[name] for by_name in parts]
        value = np.asarray(combination.function(*(one.value for one in of_parts)))
        # a combination holds only where all of its parts do
        valid = np.all([one.valid for one in of_parts], axis=0)
        holds, unknown = valid & combination.holds(value), np.full(value.shape, np.nan)
        answer[name] = Calculated(value, holds, combination.range, unknown)
    return answer


def only(answer: Calculation, quantity: str = "", law: str = "") -> Calculation:
    """Return one quantity or law of a calculation; "" selects all of them.

    Quantities that the law does not predict are left out.
    """
    selected = {
        name: {of: one for of, one in by_name.items() if law in ("", of)}
        for name, by_name in answer.items()
        if quantity in ("", name)
    }
    return {name: by_name for name, by_name in selected.items() if by_name}


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

    def along(log_x: Numbers) -> tuple[np.ndarray, np.ndarray]:
        """Return laws and their validity at values exp(log_x) of the unknown."""
        rows = question.at(np.exp(log_x))
        found = by_law(rows, question.quantity).values()
        # inside the charge a law may be defined, but no sensor can be there
        outside = rows.slant_range > charge_radius(rows.charge_mass)
        return (
            np.stack([one.value for one in found]),
            np.stack([one.valid & outside for one in found]),
        )

    log_x = np.log(_grid(question))
    value, valid = along(log_x)
    # NaN compares false, so an undefined interval has no root inside it
    above = value >= question.target
    law, left = np.nonzero(above[:, 1:] != above[:, :-1])
    # all changes of sign of all laws are bisected together: 48 evaluations in total
    low, high = log_x[left], log_x[left + 1]
    start = above[law, left]
    for _ in range(BISECTIONS if len(law) else 0):
        middle = 0.5 * (low + high)
        now = along(middle)[0][law, np.arange(len(law))]
        same = (now >= question.target) == start
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    found = 0.5 * (low + high)
    holds = along(found)[1] if len(law) else np.zeros((len(laws), 0), bool)
    return {
        one.name: Roots(
            law=one,
            value=np.exp(found[law == i]),
            valid=holds[i, law == i],
            attained=_span(value[i, valid[i]]),
        )
        for i, one in enumerate(laws)
    }


def _grid(question: Question) -> Float[np.ndarray, " point"]:
    """Return ranges or masses of the explosive to search, ascending."""
    one_kg = Rows(question.scene, np.ones(1), np.ones(1)).path(question.quantity)
    # Sachs scaling: Z of the ambient pressure, not of the standard one
    factor = sachs_distance_factor(one_kg.charge_mass, one_kg.ambient_pressure)
    ranges = SCALED_DISTANCES * factor
    if question.charge_mass:
        return ranges * np.cbrt(question.charge_mass[0])
    return (question.slant_range[0] / ranges[::-1]) ** 3


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
    choice: Choice | None = field(default=None, metadata=HIDDEN)
    is_nearest: bool = field(default=False, metadata=HIDDEN)
    solutions: tuple[float, ...] | None = field(default=None, metadata=ABSENT)


def recommended_by_row(
    rows: Rows, answer: Calculation, most: int | None = None
) -> list[dict[str, Recommended]]:
    """Return the recommended value of each quantity at each row.

    Args:
        rows: Ranges and masses.
        answer: Values of the laws there.
        most: Largest number of rows, the first ones; None for all.
    """
    found: list[dict[str, Recommended]] = [{} for _ in rows.slant_range[:most]]
    for quantity, by_name in answer.items():
        for row, recommended in enumerate(found):
            law, choice = _recommended_law(rows, quantity, tuple(by_name), row)
            one = by_name[law]
            recommended[quantity] = Recommended(
                quantity=quantity,
                law=law,
                value=float(one.value[row]),
                valid=bool(one.valid[row]),
                scatter=float(one.scatter[row]),
                choice=choice,
            )
    return found


def _recommended_law(
    rows: Rows, quantity: str, names: Sequence[str], row: int
) -> tuple[str, Choice | None]:
    """Return the law of those named at a row, and the basis of its choice.

    The law of a combination is that of its first part whose law is one of them.
    """
    is_combined = quantity in COMBINATIONS
    if len(names) > 1:
        for part in COMBINATIONS[quantity].parts if is_combined else [quantity]:
            choice = rows.compared(part).choose(at=slice(row, row + 1))
            if choice.method in names:
                return choice.method, choice
    return names[0], None


def recommended_root(question: Question, by_name: Mapping[str, Roots]) -> Recommended:
    """Return the range or mass at which a quantity takes its value.

    The law is chosen at the median root of the laws that hold. If the chosen law does
    not take the value within its range, the law with the root nearest to the median is
    used.

    Args:
        question: States a quantity, its target, and one range or one mass.
        by_name: From `roots`.
    """
    best = {name: found.best() for name, found in by_name.items()}
    holding = {name: root[0] for name, root in best.items() if root and root[1]}
    if not holding:
        nothing = math.nan
        return Recommended(question.unknown, "", nothing, False, nothing, solutions=())
    quantity = question.quantity
    # median of logarithms: one outlying law does not decide where laws are compared
    middle = math.exp(float(np.median(np.log(list(holding.values())))))
    law, choice = _recommended_law(question.at(middle), quantity, tuple(by_name), 0)
    is_nearest = law not in holding
    if is_nearest:
        law = min(holding, key=lambda name: abs(math.log(holding[name] / middle)))
    value = holding[law]
    # the slope d ln(quantity) / d ln(unknown), and the scatter at the answer itself
    around = question.at(value * np.exp([-STEP, 0.0, STEP]))
    here = by_law(around, quantity)[law]
    low, _, high = np.log(here.value)
    slope = (high - low) / (2.0 * STEP)
    return Recommended(
        quantity=question.unknown,
        law=law,
        value=value,
        valid=True,
        scatter=float(here.scatter[1] / abs(slope)) if slope else math.nan,
        solutions=tuple(map(float, by_name[law].value[by_name[law].valid])),
        choice=None if is_nearest else choice,
        is_nearest=is_nearest,
    )


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
    choice: Choice | None = field(metadata=HIDDEN)


def disagreements(rows: Rows, answer: Calculation) -> list[Disagreement]:
    """Return one disagreement per quantity whose valid laws disagree."""
    found = []
    for quantity, by_name in answer.items():
        pairs = list(combinations(by_name, 2))
        sds = np.array([_sds_apart(by_name[one], by_name[two]) for one, two in pairs])
        if not (sds > BEYOND).any():
            continue
        # the largest difference of two laws
        which, row = np.unravel_index(int(sds.argmax()), sds.shape)
        low, high = sorted(pairs[which], key=lambda name: by_name[name].value[row])
        both = by_name[low].scatter[row], by_name[high].scatter[row]
        choice = None
        if references(quantity):
            choice = rows.compared(quantity).choose(at=slice(row, row + 1))
        found.append(
            Disagreement(
                quantity=quantity,
                low=low,
                high=high,
                ratio=float(by_name[high].value[row] / by_name[low].value[row]),
                expected=math.exp(BEYOND * math.hypot(*both)),
                range_m=float(rows.slant_range[row]),
                mass_kg=float(rows.charge_mass[row]),
                rows=int((sds > BEYOND).any(axis=0).sum()),
                choice=choice,
            )
        )
    return found


def _sds_apart(one: Calculated, other: Calculated) -> Numbers:
    """Return |ln ratio| of two laws in standard deviations; 0 where one is invalid.

    Also where one has no scatter, as combinations of several laws.
    """
    # independent scatter of two laws: the variance of their difference is the sum
    with np.errstate(all="ignore"):
        off = np.log(one.value / other.value) / np.hypot(one.scatter, other.scatter)
    return np.where(one.valid & other.valid & np.isfinite(off), np.abs(off), 0.0)
