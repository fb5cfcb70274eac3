"""What each quantity is held against, and where that is known.

For real TNT the reference is Kingery and Bulmash as far as their tables reach, and
beyond them the weak shock with the absorption of ISO 9613-1, which for the peak ends
where recorded peaks leave it, for impulse and duration
the recordings that `ford_2021` was fitted to. How far a reference itself may be off,
$e_{ref}$, is measured by `calibration/fidelity.py`, against recordings where there are
any, and stored in
`data/references.csv`. The exact point source is the reference of numerics alone: it is
what the shock solver is held against.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

import jblast.waves as _waves  # noqa: F401  laws enter the registry as they are imported
from jblast.registry import call, law_for
from jblast.waves.paths import Path
from jblast.waves.scaling import scaled_distance
from jblast.waves.shock import FAR_END

KINGERY_BULMASH_END = 40.0
"""Where the tables of Kingery and Bulmash end [m/kg^(1/3)]."""

FORD_START = 20.0
"""Where the recordings of `ford_2021` begin [m/kg^(1/3)]."""

END = 1000.0
"""Scaled distance up to which there is a reference, but for the peak [m/kg^(1/3)]."""

FARTHEST = 5000.0
"""Distance up to which there is one past the tables [m]: farther, weather decides."""


class Branch(NamedTuple):
    """A law that is the reference over a span of scaled distances.

    Attributes:
        law: Its name.
        start: Scaled distance it begins past [m/kg^(1/3)].
        end: Scaled distance it ends at.
        lossless: The law it is without absorption; itself where it has none.
    """

    law: str
    start: float
    end: float
    lossless: str


def _branch(law: str, start: float, end: float, lossless: str = "") -> Branch:
    return Branch(law, start, end, lossless or law)


NEAR = _branch("kingery_bulmash", 0.0, KINGERY_BULMASH_END)


REFERENCES: dict[str, tuple[Branch, ...]] = {
    "air_arrival_s": (NEAR, _branch("shock_kinematics", KINGERY_BULMASH_END, END)),
    "peak_overpressure_pa": (
        NEAR,
        _branch("weak_shock_iso", KINGERY_BULMASH_END, FAR_END, "shock_kinematics"),
    ),
    "shock_speed_m_s": (NEAR, _branch("shock_kinematics", KINGERY_BULMASH_END, END)),
    **dict.fromkeys(
        ("positive_impulse_pa_s", "positive_duration_s"),
        (
            _branch("kingery_bulmash", 0.0, FORD_START),
            _branch("ford_2021", FORD_START, END),
        ),
    ),
    **dict.fromkeys(("reflected_pressure_pa", "reflected_impulse_pa_s"), (NEAR,)),
}
"""By quantity, nearest first. The others have none."""


def scaled_distances(path: Path) -> Float[np.ndarray, " place"]:
    """Return Z of every place of a path [m/kg^(1/3)]."""
    z = scaled_distance(path.slant_range, path.charge_mass, path.ambient_pressure)
    return np.atleast_1d(np.asarray(z))


def covers(
    branch: Branch, z: Float[np.ndarray, " place"]
) -> Bool[np.ndarray, " place"]:
    """Return where a branch is the reference: a join belongs to what lies before it."""
    return (z > branch.start) & (z <= branch.end)


def is_reference(
    quantity: str, name: str, z: Float[np.ndarray, " place"], *, lossless: bool = False
) -> bool:
    """Return whether a method is a quantity's reference at all of some Z.

    Args:
        quantity: Any; of one without reference none is.
        name: Of the method.
        z: Scaled distances [m/kg^(1/3)].
        lossless: Whether absorption is left out of the reference.
    """
    branches = [
        branch
        for branch in REFERENCES.get(quantity, ())
        if name == (branch.lossless if lossless else branch.law)
    ]
    return bool(branches) and bool(
        np.any([covers(p, z) for p in branches], axis=0).all()
    )


def continues_reference(
    quantity: str, name: str, z: Float[np.ndarray, " place"]
) -> bool:
    """Return whether a method is the reference, or continues it past its last end.

    Without absorption, everywhere. At Z = 600 no method holds for the peak: the weak
    shock continues the reference, and the power law that the tables continue by does
    not.
    """
    starts = [branch.start for branch in REFERENCES.get(quantity, ())]
    if not starts:
        return False
    at = np.searchsorted(starts, z, side="left") - 1
    nearest = [REFERENCES[quantity][max(int(i), 0)].lossless for i in at]
    return all(law == name for law in nearest)


def is_too_far(
    z: Float[np.ndarray, " place"], slant_range: Float[Array | np.ndarray, " place"]
) -> Bool[np.ndarray, " place"]:
    """Return where a place past the tables is farther than any reference."""
    return (z > KINGERY_BULMASH_END) & (np.asarray(slant_range) > FARTHEST)


def reference_value(
    quantity: str, path: Path, *, lossless: bool = False
) -> Float[Array, " place"]:
    """Return what the reference says; NaN where there is none.

    Args:
        quantity: One of `REFERENCES`.
        path: To every place; the mass is that of TNT.
        lossless: Whether to leave absorption out.
    """
    z = scaled_distances(path)
    value = jnp.full(z.shape, jnp.nan)
    for branch in REFERENCES[quantity]:
        law = law_for(quantity, branch.lossless if lossless else branch.law)
        said = jnp.where(call(law.valid, path), call(law.function, path), jnp.nan)
        value = jnp.where(covers(branch, z), said, value)
    return jnp.where(is_too_far(z, path.slant_range), jnp.nan, value)
