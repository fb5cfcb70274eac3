"""The law of each quantity if none is specified, and the burst of each row.

One law is used for each quantity of a log: `fidelity.choose_for` over the positions of
its rows, within a third of their smallest sigma. If the height of the charge decides
between the curve sets of a surface burst and of free air, `settled` decides for each
row. Laws and curve sets are chosen before a search, and again at its result. They are
constant during a search, so that it has derivatives.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import jax
import numpy as np
from jaxtyping import Bool, Float

from jblast.errors import InputError, argument, nearest
from jblast.fidelity import TakenLaw, choose_for, tolerance_of
from jblast.fidelity.errors import Conditions, conditions_of
from jblast.kept_programs import kept
from jblast.quantities import QUANTITIES
from jblast.registry import LAWS, is_law, names, names_for
from jblast.scene import Charge, Scene
from jblast.scene.charge import BURSTS, Burst
from jblast.sensors.layout import Layout, components
from jblast.sensors.record import path_to
from jblast.waves.height_of_burst import burst_notes, scaled_height

_LAWS = argument("laws")


def resolve_laws(
    scene: Scene, layout: Layout, sigma: Float[np.ndarray, " row"] | None = None
) -> dict[str, TakenLaw]:
    """Return the law of every quantity: the scene's, else chosen.

    Args:
        scene: Charges, air, ground and sensors.
        layout: Rows of a log.
        sigma: Sigma of each row; seconds for times, else relative; NaN if unknown. None
            selects the best law.

    Raises:
        InputError: The scene names a law that does not predict a quantity, or a
            quantity has no law yet.
    """
    chosen = dict(scene.law)
    for quantity, name in chosen.items():
        if name != "auto" and not is_law(quantity, name):
            raise InputError(
                f"[law] {quantity} = {name!r}: expected auto or one of "
                f"{', '.join(names_for(quantity)) or '(none yet)'}"
                f"{nearest(name, names_for(quantity))}"
            )
    # an explicit law is never replaced
    left = [q for q in layout.quantities() if chosen.get(q, "auto") == "auto"]
    automatic = choose_laws(scene, layout, left, sigma) if left else {}
    return {
        quantity: automatic.get(quantity, TakenLaw(chosen.get(quantity, "")))
        for quantity in layout.quantities()
    }


def laws_named(words: Sequence[str], quantities: Collection[str]) -> dict[str, str]:
    """Return a law for each quantity from command-line words; later words win.

    Args:
        words: "auto", NAME or QUANTITY=NAME, several with commas between.
        quantities: Quantities of the log: a word that concerns none is rejected.

    Raises:
        InputError: There is no such quantity or law, the law does not predict the
            quantity, or the log does not contain it.
    """
    # a difference of arrivals needs the laws of both arrivals
    needed = {part for quantity in quantities for part, _ in components(quantity)}
    chosen: dict[str, str] = {}
    for word in (part.strip() for item in words for part in item.split(",")):
        quantity, equals, name = word.rpartition("=")
        given = (
            _law_of_quantity(word, quantity, name) if equals else _laws_of_name(word)
        )
        if not needed & given.keys():
            raise InputError(
                f"{_LAWS} {word}: expected a law for a quantity of the log "
                f"({', '.join(sorted(needed))}), got one for "
                f"{', '.join(sorted(given))}"
            )
        chosen |= given
    return chosen


def _law_of_quantity(word: str, quantity: str, name: str) -> dict[str, str]:
    """Return the law of one quantity."""
    if quantity not in QUANTITIES:
        raise InputError(
            f"{_LAWS} {word}: expected a quantity before '=', got {quantity!r}"
            f"{nearest(quantity, QUANTITIES)}"
        )
    parts = [part for part, _ in components(quantity)]
    if parts != [quantity]:
        raise InputError(
            f"{_LAWS} {word}: {quantity} is made of {' and '.join(parts)}; "
            "expected a law for one of these"
        )
    if name != "auto" and name not in names_for(quantity):
        raise InputError(
            f"{_LAWS} {word}: expected auto or one of "
            f"{', '.join(names_for(quantity)) or '(none yet)'}, got {name!r}"
            f"{nearest(name, names_for(quantity))}"
        )
    return {quantity: name}


def _laws_of_name(name: str) -> dict[str, str]:
    """Return the named law for every quantity that it predicts."""
    if name == "auto":
        return dict.fromkeys(QUANTITIES, "auto")
    if name in names():
        return {quantity: law for quantity, law in LAWS if law == name}
    raise InputError(
        f"{_LAWS} {name}: expected auto, NAME or QUANTITY=NAME with NAME one of "
        f"{', '.join(names())}, got {name!r}{nearest(name, names())}"
    )


def choose_laws(
    scene: Scene,
    layout: Layout,
    quantities: Sequence[str],
    sigma: Float[np.ndarray, " row"] | None = None,
) -> dict[str, TakenLaw]:
    """Return the automatic law of some quantities of a layout.

    Raises:
        InputError: A quantity has no law yet.
    """
    for quantity in quantities:
        if not names_for(quantity):
            raise InputError(f"no law predicts {quantity}: not supported yet")
    stated = np.full(len(layout.quantity), np.nan) if sigma is None else np.array(sigma)
    if any(charge.burst is None for charge in scene.charges) and not layout.free_air:
        scene, layout = settled(scene, layout)
    conditions = jax.tree.map(np.asarray, _conditions(scene, layout, tuple(quantities)))
    return {
        quantity: _choose(quantity, scene, layout, conditions[quantity], stated)
        for quantity in quantities
    }


@kept
def _conditions(
    scene: Scene, layout: Layout, quantities: tuple[str, ...]
) -> dict[str, list[Conditions | None]]:
    """Return the conditions at the rows of each quantity, from every charge."""
    conditions: dict[str, list[Conditions | None]] = {
        quantity: [] for quantity in quantities
    }
    for charge, shot, burst in _charges(scene):
        # one burst per call: the errors of laws are tabulated by curve set
        path = replace(path_to(scene, layout, charge), burst=burst)
        for quantity, found in conditions.items():
            rows = _rows(layout, quantity, shot, charge, burst)
            to_rows = replace(
                jax.tree.map(lambda x, rows=rows: x[rows] if x.ndim else x, path),
                charge_mass=charge.tnt_mass(quantity),
            )
            found.append(conditions_of(quantity, to_rows) if rows.size else None)
    return conditions


def _charges(scene: Scene) -> list[tuple[Charge, int, Burst]]:
    """Return every charge with its number, once per curve set of its rows."""
    return [
        (charge, shot, burst)
        for shot, charge in enumerate(scene.charges)
        for burst in (BURSTS if charge.burst is None else (charge.burst,))
    ]


def _rows(
    layout: Layout, quantity: str, shot: int, charge: Charge, burst: Burst
) -> np.ndarray:
    """Return the rows of a quantity that have a curve set."""
    rows, _ = layout.rows(quantity, shot)
    if charge.burst is None:
        rows = rows[np.array(layout.free_air)[rows] == (burst == "free-air")]
    return rows


def _choose(
    quantity: str,
    scene: Scene,
    layout: Layout,
    conditions: Sequence[Conditions | None],
    sigma: Float[np.ndarray, " row"],
) -> TakenLaw:
    """Return the chosen law of one quantity."""
    found, shares = [], []
    for (charge, shot, burst), each in zip(_charges(scene), conditions, strict=True):
        if each is not None:
            rows = _rows(layout, quantity, shot, charge, burst)
            found.append(each)
            shares.append(tolerance_of(sigma[rows], quantity, [each]))
    # the strictest stated tolerance of any row; without one the best law wins
    stated = [share for share in shares if share > 0.0]
    tolerance = min(stated, default=0.0)
    choice = choose_for(quantity, found, tolerance)
    return TakenLaw(choice.method, choice)


def law_names(laws: Mapping[str, TakenLaw]) -> dict[str, str]:
    """Return only the names of laws."""
    return {quantity: law.name for quantity, law in laws.items()}


def settled(scene: Scene, layout: Layout) -> tuple[Scene, Layout]:
    """Return scene and layout with the curve sets that the heights leave open.

    A charge whose rows all have one set gets that set; otherwise the layout has it row
    by row. Earlier decisions are made again.
    """
    charges, free = [], np.zeros(len(layout.quantity), bool)
    for shot, charge in enumerate(scene.charges):
        if charge.burst is None or charge.by_height:
            here = np.array(layout.shot) == shot
            free |= here & free_rows(scene, layout, charge)
            # a charge without rows gets the surface curves
            kinds = set(free[here].tolist()) or {False}
            burst = (
                None if len(kinds) == 2 else "free-air" if True in kinds else "surface"
            )
            charge = replace(charge, burst=burst, by_height=True)
        charges.append(charge)
    mixed = any(charge.burst is None for charge in charges)
    scene = replace(scene, charges=tuple(charges))
    return scene, replace(layout, free_air=tuple(free.tolist()) if mixed else ())


def free_rows(scene: Scene, layout: Layout, charge: Charge) -> Bool[np.ndarray, " row"]:
    """Return a mask of the rows reached by the reflection after the positive phase."""
    if not float(charge.up) > 0.0:
        return np.zeros(len(layout.quantity), bool)
    undecided = replace(charge, burst=None, by_height=False)
    path = path_to(scene, replace(layout, free_air=()), undecided)
    return np.asarray(path.free_air) >= 1.0


def height_notes(scene: Scene, layout: Layout, shot: int) -> list[str]:
    """Return notes on the curves of a charge above the ground, and their limits.

    Args:
        scene: Settled scene; a burst that was not stated is marked `by_height`.
        layout: The rows.
        shot: Index of the charge.
    """
    charge = scene.charges[shot]
    here = np.array(layout.shot) == shot
    free = free_rows(scene, layout, charge)[here]
    height = float(scaled_height(scene, charge))
    return burst_notes(charge, (height, height), free, "reading")
