"""Every quantity by every law that gives it: the calculator's way forward."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

import jblast.waves as _waves  # noqa: F401  laws enter the registry as they are imported
from jblast.errors import InputError
from jblast.kept_programs import kept
from jblast.quantities import DERIVED_QUANTITIES, QUANTITIES
from jblast.registry import LAWS, Law, call
from jblast.scene import Scene
from jblast.scene.charge import Burst
from jblast.sensors.calculator.combined import COMBINATIONS, combined_of
from jblast.sensors.calculator.question import scene_path, with_rows
from jblast.types import as_float_array

NEEDS_MORE = {"time_since_detonation", "toward_east", "jolt_east"}

FEWEST_ROWS = 64
"""Rows are padded to a power of two from here on, so few shapes are compiled."""


@dataclass(frozen=True)
class Calculated:
    """What one law says of one quantity.

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
            law = dataclasses.replace(law, range=combination.range)
        two_sets = "burst" in law.arguments()
        of_law = Calculated(values[i], valid[i], law.range, two_sets)
        answer.setdefault(quantity, {})[name] = of_law
    return answer


def only(answer: Calculation, quantity: str = "", law: str = "") -> Calculation:
    """Return what was asked for of a calculation alone; "" leaves quantity or law open.

    Quantities that the law does not give are left out.
    """
    kept = {
        name: {of: one for of, one in by_law.items() if law in ("", of)}
        for name, by_law in answer.items()
        if quantity in ("", name)
    }
    return {name: by_law for name, by_law in kept.items() if by_law}


def with_other_burst(scene: Scene) -> Scene:
    """Return the scene with the other of the two curve sets."""
    other: Burst = "surface" if scene.charge.burst == "free-air" else "free-air"
    charge = dataclasses.replace(scene.charge, burst=other)
    return dataclasses.replace(scene, charge=charge)


def evaluate(
    scene: Scene,
    slant_range: Float[np.ndarray, " row"],
    charge_mass: Float[np.ndarray, " row"],
    laws: tuple[Law, ...],
) -> tuple[Float[np.ndarray, "law row"], Bool[np.ndarray, "law row"]]:
    """Return values and validity of some laws, then of what they give together."""
    charge = scene.charge
    if charge.burst is None and not float(charge.up) > 0.0:  # half of the program
        scene = dataclasses.replace(
            scene, charge=dataclasses.replace(charge, burst="surface", by_height=True)
        )
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
