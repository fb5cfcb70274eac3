"""Keys of a scene in another unit than ours: refused, with the factor.

A scene keeps to one unit a key, so that what is read is what was written; a log, which
instruments write, is converted.
"""

from collections.abc import Collection

CELSIUS = "add 273.15"
FAHRENHEIT = "subtract 32, multiply by 5/9 and add 273.15"
TEMPERATURES = {
    "c": CELSIUS, "celsius": CELSIUS, "degc": CELSIUS, "deg_c": CELSIUS,
    "f": FAHRENHEIT, "fahrenheit": FAHRENHEIT, "degf": FAHRENHEIT, "deg_f": FAHRENHEIT,
}  # fmt: skip
"""Endings of temperatures, and what makes kelvins of them: no factor does."""
PER_CENT = ("percent", "pct")
LONGEST = 3
"""Words of the longest ending: km_per_h."""


def in_other_unit(key: str, known: Collection[str]) -> str:
    """Return "; ours is mass_kg: multiply by ..." for a key in a unit we know.

    Args:
        key: A key that its table does not have.
        known: Those it has.

    Returns:
        What to write in its place; "" where its unit is none, or no key of ours has the
        same words before it.
    """
    from jblast.units import si_factor, unit_spelt  # of a refusal alone
    from jblast.units.vocabulary import SI

    words = key.split("_")
    for length in range(min(LONGEST, len(words) - 1), 0, -1):
        stem, suffix = "_".join(words[:-length]).lower(), "_".join(words[-length:])
        if suffix.lower() in TEMPERATURES and f"{stem}_k" in known:
            return f"; ours is {stem}_k: {TEMPERATURES[suffix.lower()]}"
        if suffix.lower() in PER_CENT and stem in known:
            return f"; ours is {stem}, a share: multiply by 0.01"
        meant = unit_spelt(suffix)
        either = [unit for unit in meant if f"{stem}_{SI.get(unit.dimension)}" in known]
        if len(meant) > 1 and either:
            names = " or ".join(unit.pint for unit in either)
            ours = f"{stem}_{SI[either[0].dimension]}"
            return f"; ours is {ours}, and {suffix!r} may be {names}"
        if either:
            ours = f"{stem}_{SI[either[0].dimension]}"
            return f"; ours is {ours}: multiply by {si_factor(suffix):.9g}"
    return ""
