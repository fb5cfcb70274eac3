"""Combinations of parameters in words: `air_sound_speed_m_s * charge_mass_kg^0.2`."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float


def combination(
    names: Sequence[str], space: Sequence[str], weights: Float[np.ndarray, " free"]
) -> tuple[str, bool]:
    """Name a linear form in the coordinates.

    Returns:
        The name, and whether it is a product of powers (every part is in ln).
    """
    parts = [(n, s, w) for n, s, w in zip(names, space, weights, strict=True) if w != 0]
    if all(s == "ln" for _, s, _ in parts):
        return " * ".join(
            name if _short(w) == "1" else f"{name}^{_short(w)}" for name, _, w in parts
        ), True
    terms = [(f"ln({n})" if s == "ln" else n, w) for n, s, w in parts]
    first, *rest = [
        (w < 0, name if _short(abs(w)) == "1" else f"{_short(abs(w))} * {name}")
        for name, w in terms
    ]
    text = ("-" if first[0] else "") + first[1]
    return text + "".join(f" {'-' if neg else '+'} {t}" for neg, t in rest), False


def space_of(space: Sequence[str], weights: Float[np.ndarray, " free"]) -> str:
    """Return the space a direction is told in: "ln", "linear" or "mixed"."""
    used = {s for s, w in zip(space, weights, strict=True) if w != 0}
    return used.pop() if len(used) == 1 else "mixed"


def _short(weight: float) -> str:
    return f"{weight:.4g}"
