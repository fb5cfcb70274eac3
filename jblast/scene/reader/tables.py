"""Tables of a scene file: their shape, and that every key in them is one we know."""

from collections.abc import Sequence
from typing import Any

from jblast.errors import InputError, nearest, shown
from jblast.scene.reader.foreign_keys import in_other_unit
from jblast.scene.reader.schema import KEYS, LATER


def not_yet(where: str, what: str) -> InputError:
    """Return the error for what the contract has and nothing is built for."""
    return InputError(f"{where}: {what} is not supported yet")


def table(document: dict[str, Any], name: str, where: str) -> dict[str, Any]:
    """Return a table of the file, its keys checked; empty where it is absent."""
    value = document.get(name, {})
    if not isinstance(value, dict):
        raise InputError(
            f"{where}: [{name}]: expected one table written [{name}], "
            f"got {shown(value)}"
        )
    known_keys(value, name, f"{where}: [{name}]")
    return value


def tables(document: dict[str, Any], name: str, where: str) -> list[dict[str, Any]]:
    """Return the entries of an array of tables, their keys checked."""
    entries = document.get(name, [])
    if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
        raise InputError(
            f"{where}: [[{name}]]: expected tables written [[{name}]], "
            f"got {shown(entries)}"
        )
    for entry in entries:
        known_keys(entry, name, f"{where}: [[{name}]]")
    return entries


def known_keys(entry: dict[str, Any], name: str, where: str) -> None:
    """Refuse a key that the table does not have, and one that waits to be built."""
    known, later = KEYS[name], LATER.get(name, ())
    for key in entry:
        if key in later:
            raise not_yet(f"{where} {key}" if name else f"{where}: [{key}]", "this")
        if key not in known:
            place = (
                f"{where} {shown_key(key)}" if name else f"{where}: {shown_key(key)}"
            )
            other = in_other_unit(key, known)
            advice = other or nearest(key, (*known, *later))
            kind = "table" if isinstance(entry[key], dict) else "key"
            raise InputError(
                f"{place}: unknown {kind}{advice}; expected one of {', '.join(known)}"
            )


def choice(
    value: Any, known: Sequence[str], where: str, later: Sequence[str] = ()
) -> str:
    """Return one of a few words."""
    if isinstance(value, str) and value in later:
        raise not_yet(where, f'"{value}"')
    if not isinstance(value, str) or value not in known:
        advice = nearest(value, known) if isinstance(value, str) else ""
        raise InputError(
            f"{where}: expected one of {', '.join(known)}, got {shown(value)}{advice}"
        )
    return value


def true_or_false(value: Any, where: str) -> bool:
    """Return a truth value."""
    if not isinstance(value, bool):
        raise InputError(f"{where}: expected true or false, got {shown(value)}")
    return value


def name_of(value: Any, where: str) -> str:
    """Return a name: text that is not empty."""
    if not isinstance(value, str) or not value.strip():
        raise InputError(f"{where}: expected a name in quotes, got {shown(value)}")
    return value.strip()


def number_list(value: Any, where: str, expected: str) -> list[Any]:
    """Return a list as long as the one written in what is expected: "[east, north]"."""
    if not isinstance(value, list) or len(value) != expected.count(",") + 1:
        raise InputError(f"{where}: expected {expected}, got {shown(value)}")
    return value


def shown_key(key: str) -> str:
    """Return a key as it is written, or quoted where it would break a message."""
    return key if key.isidentifier() and len(key) <= 60 else shown(key)
