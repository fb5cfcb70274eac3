"""Reader of a scene's random blasts."""

from typing import Any

from jblast.errors import InputError, shown
from jblast.scene.random_blasts import (
    ABOUT,
    WORLD_NUMBERS,
    Box,
    ByCount,
    ByRate,
    ByTick,
    Number,
    Ring,
    WorldSpec,
)
from jblast.scene.reader.tables import (
    LISTS,
    choice,
    finite,
    fixed_list,
    known_keys,
    not_yet,
    read_number,
    table,
)
from jblast.scene.uncertain import Free, Prior, Uniform
from jblast.types import as_float_array

MAX_BLASTS = 10_000
"""Maximum number of blasts of a world; declared: more are probably a mistake."""
OCCURRENCES = ("count", "rate_hz", "probability")


def read_random_blasts(document: dict[str, Any], source: str) -> WorldSpec:
    """Read the table [world] of a scene file.

    Args:
        document: The tables of the file.
        source: Name of the file, for messages.

    Raises:
        InputError: There is no [world], a value in it is invalid, its region has no
            extent, the blasts do not fit with their gap, or its vehicle is missing.
    """
    where = f"{source}: [world]"
    if "world" not in document:
        raise InputError(f"{where}: expected a table of random blasts, got none")
    entry = table(document, "world", source)
    occurrence = _occurrence(entry, where)
    values: dict[str, Any] = {
        # The fields of `WorldSpec` are the keys without their units.
        key.partition("_")[0]: _number(entry[key], key, f"{where} {key}")
        for key in ("mass_kg", "time_s", "gap_s")
        if key in entry
    }
    region = entry.get("region_m", {})
    if not isinstance(region, dict):
        raise InputError(
            f"{where} region_m: expected {{ box = {LISTS['box']} }} or "
            f"{{ ring = {LISTS['ring']} }}, got {shown(region)}"
        )
    # Checked first, so that a misspelt box is named and not taken for none.
    known_keys(region, "region", f"{where} region_m")
    if (about := _about(entry, region, where)) is not None:
        values["about"] = about
    if about == "vehicle" and "vehicle" not in document:
        raise InputError(
            f"{where} about: expected a [vehicle] as centre of the region, got "
            '"vehicle" without that table'
        )
    if {"box", "ring"} & set(region):
        values["region"] = _region(region, f"{where} region_m")
    world = WorldSpec(occurrence=occurrence, **values)
    _check_times(world, where)
    return world


def _occurrence(entry: dict[str, Any], where: str) -> ByCount | ByRate | ByTick:
    given = [key for key in OCCURRENCES if key in entry]
    if len(given) > 1:
        raise InputError(
            f"{where} {given[1]}: expected one of {', '.join(OCCURRENCES)}, got "
            f"{' and '.join(given)}"
        )
    if "tick_s" in entry and "probability" not in given:
        raise InputError(
            f"{where} tick_s: expected probability (of a blast at a tick) with it, got "
            "none"
        )
    if "rate_hz" in given:
        return ByRate(_number(entry["rate_hz"], "rate_hz", f"{where} rate_hz"))
    if "probability" in given:
        chance = finite(entry["probability"], f"{where} probability")
        if not 0.0 < chance <= 1.0:
            raise InputError(
                f"{where} probability: expected a number above 0 and at most 1, got "
                f"{shown(entry['probability'])}"
            )
        if "tick_s" not in entry:
            raise InputError(
                f"{where} tick_s: expected the time from tick to tick with "
                "probability, got nothing"
            )
        tick = finite(entry["tick_s"], f"{where} tick_s")
        if not 1e-3 <= tick <= 1e6:
            raise InputError(
                f"{where} tick_s: expected 0.001 to 1e6 s, got {shown(entry['tick_s'])}"
            )
        return ByTick(chance, tick)
    if "count" not in given:
        return WorldSpec().occurrence
    count = entry["count"]
    if type(count) is not int or not 1 <= count <= MAX_BLASTS:
        raise InputError(
            f"{where} count: expected a whole number, 1 to {MAX_BLASTS:,}, got "
            f"{shown(count)}"
        )
    return ByCount(count)


def _number(value: Any, key: str, where: str) -> Number:
    """Return a number or its prior; a pair is a uniform prior."""
    # A free number has no distribution to sample from.
    if value == "free":
        raise InputError(
            f"{where}: expected a number or a prior to sample from, got 'free'"
        )
    if isinstance(value, list):
        value = {"uniform": value}
    fixed, belief = read_number(value, WORLD_NUMBERS[key], where)
    if belief is None or isinstance(belief, Free):
        return as_float_array(fixed)
    return belief


def _about(entry: dict[str, Any], region: dict[str, Any], where: str) -> Any:
    """Return the centre of the region, from either table; None if unspecified."""
    if "about" in entry and "about" in region:
        raise InputError(f"{where} about: expected it once, got it in region_m, too")
    for holder, at in ((entry, f"{where} about"), (region, f"{where} region_m about")):
        if "about" in holder:
            return choice(holder["about"], ABOUT, at)
    return None


def _region(region: dict[str, Any], where: str) -> Box | Ring:
    if {"box", "ring"} <= set(region):
        raise InputError(f"{where}: expected either box or ring, got both")
    if "ring" in region:
        where += " ring"
        inner, outer = fixed_list(region["ring"], where, LISTS["ring"]).tolist()
        if not 0.0 <= inner < outer:
            raise InputError(
                f"{where}: expected {LISTS['ring']} with 0 <= inner < outer, so that "
                f"the ring has an area, got {shown(region['ring'])}"
            )
        return Ring(inner, outer)
    corners, where = region["box"], f"{where} box"
    if not isinstance(corners, list) or len(corners) != 2:
        raise InputError(f"{where}: expected {LISTS['box']}, got {shown(corners)}")
    low, high = (
        fixed_list(corner, f"{where}[{n}]", LISTS["position_m"])
        for n, corner in enumerate(corners)
    )
    for axis, (least, most) in enumerate(zip(low, high, strict=True)):
        flat = axis == 2 and least == most  # a region of constant height is valid
        if not (least < most or flat):
            name = ("east", "north", "up")[axis]
            raise InputError(
                f"{where}: expected a region with an extent, its first corner less "
                f"than its second {name}, got {shown(corners)}"
            )
    return Box(low, high)


def _check_times(world: WorldSpec, where: str) -> None:
    """Reject times that do not fit the requested blasts."""
    gap = world.gap
    least = float(getattr(gap, "lo", 0.0) if isinstance(gap, Prior) else gap)
    first, last = world.window
    if not isinstance(world.occurrence, ByCount):
        if not isinstance(world.time, Uniform):
            raise InputError(
                f"{where} time_s: expected {{ uniform = [from, to] }} with rate_hz or "
                "probability, the interval with blasts, got another form"
            )
        return
    drawn_freely = isinstance(world.time, Prior) and not isinstance(world.time, Uniform)
    if drawn_freely and (least > 0 or isinstance(gap, Prior)):
        # Sampling sorts uniform times within the interval less the gaps; for another
        # distribution that changes its shape.
        raise not_yet(f"{where} gap_s", "a gap between times that are not uniform")
    count = world.occurrence.count
    check_fits(count, first, last, least, where)


def check_fits(count: int, first: float, last: float, gap: float, where: str) -> None:
    """Reject more blasts than fit into an interval with their gap.

    Args:
        count: Number of blasts.
        first: Beginning of the interval [s].
        last: End of the interval [s].
        gap: Minimum time between two blasts [s].
        where: File and table, for the message.

    Raises:
        InputError: They do not fit.
    """
    # Two blasts at one fixed time would be one: also refused without a gap.
    if (count - 1) * gap > last - first or (count > 1 and first == last):
        most = int((last - first) / gap) + 1 if last > first and gap else 1
        raise InputError(
            f"{where} count: expected at most {most}, which fit between "
            f"{first:g} and {last:g} s at gap_s {gap:g}, got {count}"
        )
