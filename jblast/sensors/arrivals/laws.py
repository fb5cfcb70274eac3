"""By which laws a record over time is made."""

from collections.abc import Mapping

from jblast.errors import InputError, nearest
from jblast.registry import is_law, names_for
from jblast.scene import Scene

AIR_QUANTITIES = (
    "air_arrival_s",
    "peak_overpressure_pa",
    "positive_duration_s",
    "positive_impulse_pa_s",
)
"""What decides a wave in air."""

DEFAULT_RECORD_LAWS: dict[str, str] = dict.fromkeys(AIR_QUANTITIES, "shock_kinematics")
"""One picture from the charge to Z = 1e4, so that nothing has to be chosen inside jit.
"""

DEFAULT_GROUND_LAWS: dict[str, str] = {
    "ground_arrival_s": "wu_hao",
    "ground_displacement_m": "ground_motion",
    "ground_peak_velocity_m_s": "ground_motion",
}
"""What decides a wave in the ground, and the laws where nothing is said."""


def record_laws(
    scene: Scene, laws: Mapping[str, str] | None = None, *, ground: bool = False
) -> dict[str, str]:
    """Return the law of each quantity: as told, else as the scene says, else these.

    Args:
        scene: Its `law`; "auto" there leaves a quantity to `DEFAULT_RECORD_LAWS`.
        laws: By quantity; quantities that no record needs are not looked at.
        ground: Whether waves in the ground are recorded, too: with `ground_laws`.

    Raises:
        InputError: A law of that name does not give its quantity.
    """
    named = _named(scene, laws, DEFAULT_RECORD_LAWS)
    return named | ground_laws(scene, laws) if ground else named


def ground_laws(scene: Scene, laws: Mapping[str, str] | None = None) -> dict[str, str]:
    """Return the same of waves in the ground, by `DEFAULT_GROUND_LAWS`."""
    return _named(scene, laws, DEFAULT_GROUND_LAWS)


def _named(
    scene: Scene, laws: Mapping[str, str] | None, defaults: Mapping[str, str]
) -> dict[str, str]:
    """Return the law of each quantity that has a default."""
    chosen = {**dict(scene.law), **(laws or {})}
    found = {
        quantity: chosen[quantity]
        if chosen.get(quantity, "auto") != "auto"
        else default
        for quantity, default in defaults.items()
    }
    for quantity, name in found.items():
        if not is_law(quantity, name):
            known = names_for(quantity)
            raise InputError(
                f"law of {quantity}: expected one of {', '.join(known)}, got "
                f"{name!r}{nearest(name, known)}"
            )
    return found
