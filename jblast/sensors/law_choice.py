"""The law of each quantity of a log if none is specified.

One law is used for each quantity: `waves.choice.compared` at the positions of its rows,
within a third of their smallest sigma. It is chosen before a search, and again at its
result, and is constant during a search, so that it has derivatives.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from jblast.errors import require
from jblast.registry import law_for, names_for
from jblast.scene import Scene
from jblast.sensors.layout import Layout
from jblast.types import in_numpy, unconverted
from jblast.waves.choice import TakenLaw, compared, tnt_path, tolerance_of
from jblast.waves.height_of_burst import burst_notes, scaled_height
from jblast.waves.paths import path_between


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
    named = {quantity: name for quantity, name in scene.law if name != "auto"}
    for quantity, name in named.items():
        law_for(quantity, name)
    known, sigma = in_numpy(scene), np.asarray(np.nan if sigma is None else sigma)
    sigma = np.broadcast_to(sigma, len(layout.quantity))
    # an explicit law is never replaced
    return {
        quantity: TakenLaw(named[quantity])
        if quantity in named
        else _choose(quantity, known, layout, sigma)
        for quantity in layout.quantities()
    }


def _choose(
    quantity: str, scene: Scene, layout: Layout, sigma: Float[np.ndarray, " row"]
) -> TakenLaw:
    """Return the chosen law of one quantity."""
    require(names_for(quantity), quantity, "a quantity that a law predicts")
    offsets = scene.clock_offsets()
    offset = np.array([float(offsets.get(clock, 0.0)) for clock in layout.clock])
    paths, tolerances = [], []
    for shot, charge in enumerate(scene.charges):
        rows, _ = layout.rows(quantity, shot)
        if not rows.size:
            continue
        start = float(charge.as_if_at_zero().time_s)
        time = (np.asarray(layout.time) - offset - start)[rows]
        path = tnt_path(scene, charge, quantity, *_places(layout, rows), time)
        paths.append(path)
        tolerances.append(tolerance_of(sigma[rows], quantity, [path]))
    # the strictest stated tolerance of any row; without one the best law wins
    stated = [tolerance for tolerance in tolerances if tolerance > 0.0]
    choice = compared(quantity, paths).choose(min(stated, default=0.0))
    return TakenLaw(choice.method, choice)


def _places(layout: Layout, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and stated ranges of rows."""
    return np.asarray(layout.position)[rows], np.asarray(layout.slant_range)[rows]


def law_names(laws: Mapping[str, TakenLaw]) -> dict[str, str]:
    """Return only the names of laws."""
    return {quantity: law.name for quantity, law in laws.items()}


def height_notes(scene: Scene, layout: Layout, shot: int) -> list[str]:
    """Return a note on the curves of a charge off the ground, if one is due.

    Args:
        scene: Charges, air, ground and sensors.
        layout: The rows.
        shot: Index of the charge.
    """
    scene = in_numpy(scene)
    charge = scene.charges[shot]
    rows = np.flatnonzero(np.array(layout.shot) == shot)
    nothing = np.full(rows.size, np.nan)
    by_height = unconverted(charge, burst=None)
    path = path_between(scene, by_height, *_places(layout, rows), nothing)
    height = float(scaled_height(scene, charge))
    return burst_notes(charge, (height, height), np.asarray(path.free_air), "reading")
