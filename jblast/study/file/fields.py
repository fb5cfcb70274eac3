"""What a study's file says beside its scene and axes: each key, checked."""

from typing import Any

from jblast.errors import InputError, nearest, shown
from jblast.scene.reader.tables import finite
from jblast.study.file.study import DESIGNS, MOST_SAMPLES, Design, Keep

MOST_UNTIL_KNOWN = 100_000_000
"""Samples of a study that ends by its targets, where nobody says how many."""


def size_of(document: dict[str, Any], source: str) -> tuple[int, dict[str, float]]:
    """Return how many samples there are, and at which errors fewer suffice."""
    targets = document.get("sd_target", {})
    if not isinstance(targets, dict):
        raise InputError(
            f"{source}: sd_target: expected a standard error by outcome, as "
            f"{{ air_arrival_s = 1e-4 }}, got {shown(targets)}"
        )
    for name, value in targets.items():
        number = finite(value, f"{source}: sd_target {name}", "a positive number")
        if number <= 0:
            raise InputError(
                f"{source}: sd_target {name}: expected a positive number, got "
                f"{shown(value)}"
            )
    asked = document.get("outcomes")
    for name in targets:
        if isinstance(asked, list) and name not in asked:
            raise InputError(
                f"{source}: sd_target {name}: expected one of the outcomes, got "
                f"{name}{nearest(name, [str(a) for a in asked])}"
            )
    if "samples" not in document:
        if not targets:
            raise InputError(
                f"{source}: samples: expected how many draws, or sd_target, got neither"
            )
        return MOST_UNTIL_KNOWN, {name: float(value) for name, value in targets.items()}
    samples = whole_of(document["samples"], f"{source}: samples", 1, MOST_SAMPLES)
    return samples, {name: float(value) for name, value in targets.items()}


def whole_of(value: Any, where: str, least: int, most: int) -> int:
    """Return a whole number within limits; 1e6 is one."""
    if isinstance(value, float) and value.is_integer():
        value = int(value)  # 1e6
    if isinstance(value, bool) or not isinstance(value, int):
        raise InputError(f"{where}: expected a whole number, got {shown(value)}")
    if not least <= value <= most:
        raise InputError(
            f"{where}: expected a whole number from {least} to {most:,}, got {value}"
        )
    return value


def design_of(value: Any, source: str) -> Design:
    """Return how draws fill what the priors allow."""
    if value not in DESIGNS:
        raise InputError(
            f"{source}: design: expected one of {', '.join(DESIGNS)}, got "
            f"{shown(value)}{nearest(str(value), DESIGNS)}"
        )
    return value


def keep_of(value: Any, source: str) -> Keep:
    """Return what is kept of the samples."""
    if value in ("all", "summary"):
        return value
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise InputError(
            f'{source}: keep: expected "all", "summary" or how many samples, got '
            f"{shown(value)}"
        )
    return value


def outcomes_of(value: Any, source: str) -> tuple[str, ...]:
    """Return the names of the outcomes; whether there are such, the registry knows."""
    if (
        not isinstance(value, list)
        or not value
        or not all(isinstance(name, str) and name for name in value)
    ):
        raise InputError(
            f"{source}: outcomes: expected a list of names, as "
            f'["air_arrival_s"], got {shown(value)}'
        )
    twice = [name for name in value if value.count(name) > 1]
    if twice:
        raise InputError(
            f"{source}: outcomes: expected each once, got {twice[0]} "
            f"{value.count(twice[0])} times"
        )
    return tuple(value)


def options_of(value: Any, source: str) -> dict[str, Any]:
    """Return what else outcomes are told."""
    if not isinstance(value, dict):
        raise InputError(f"{source}: [options]: expected a table, got {shown(value)}")
    return dict(value)
