"""Every key of the table: good values are read, others refused by file and key."""

from typing import Any

import pytest
from jsonschema import Draft202012Validator

from docs.generate.scene_schema import scene_schema
from jblast.errors import InputError
from jblast.parameters import UNBOUNDED
from jblast.scene import SENSOR_KINDS, UncertainScene, values
from jblast.scene.keys import KEYS, SEVERAL, WITHIN
from jblast.scene.reader import scene_from_document, world_from_document
from jblast.scene.sensor_kinds import kind_keys

BASE = {
    "sensor": {"name": "a"},
    "clock": {"name": "c"},
    "place": {"lat_deg": 33.9, "lon_deg": 35.5},
    "ambient": {"level_pa": 0.1},
    "camera": {
        "position_m": [0, -50, 2],
        "look_at_m": [0, 0, 5],
        "width": 346,
        "height": 260,
        "focal_px": 300,
        "frames_hz": 0.5,
    },
    "vehicle": {"model": "iris", "position_m": [10, -5, 2]},
}
"""Tables with the required keys only."""
SCHEMA = Draft202012Validator(scene_schema())


class Case:
    """A key of a table, or of a kind of sensor."""

    def __init__(self, table, key, kind=""):
        self.table, self.key, self.kind = table, key, kind
        self.name = ".".join(filter(None, (table, kind, key.name)))

    @property
    def others(self):
        """Return the other keys of the table by name."""
        own = KEYS[self.table] + (
            kind_keys(self.kind) if self.table == "sensor" else ()
        )
        return {key.name: key for key in own}

    def entry(self, value):
        """Return the table with a value of the key, and the keys that it needs."""
        entry = {
            k: v for k, v in BASE.get(self.table, {}).items() if k != self.key.name
        }
        if self.kind:
            entry |= {"kind": self.kind}
            entry |= {"mount": "vehicle"} if self.kind == "imu" else {}
        for words in self.key.needs:
            if words.startswith("["):
                continue
            entry[words.split()[0]] = good(self.others[words.split()[0]].value)
        excluded = excluded_by(self.key) | {
            name
            for name, other in self.others.items()
            if excluded_by(other) & {self.key.name, *entry}
        }
        entry = {k: v for k, v in entry.items() if k not in excluded}
        return entry | ({} if value is None else {self.key.name: value})

    def document(self, entry):
        """Return a file with the table."""
        vehicle = {"vehicle": BASE["vehicle"]}
        if self.table == "control":
            return {"vehicle": BASE["vehicle"] | {"control": entry}}
        if self.table == "region":
            return vehicle | {"world": {"region_m": entry}}
        several = self.table in SEVERAL[1:]
        return vehicle | {self.table: [entry] if several else entry}

    def read(self, entry):
        """Return the scene of a file with the table."""
        document = self.document(entry)
        if "world" in document:
            return world_from_document(document, "s.toml")[0]
        return scene_from_document(document, "s.toml")

    def message(self, entry):
        """Return the message of the refusal of a table, after its file and heading."""
        with pytest.raises(InputError) as caught:
            self.read(entry)
        heading = (
            f"[[{self.table}]]" if self.table in SEVERAL[1:] else f"[{self.table}]"
        )
        start = f"s.toml: {WITHIN.get(self.table, heading)}"
        assert str(caught.value).startswith(start)
        return str(caught.value)


def excluded_by(key):
    """Return the names of the keys that exclude a key."""
    return {words.split()[0] for words in key.instead}


CASES = [Case(table, key) for table, keys in KEYS.items() for key in keys] + [
    Case("sensor", key, kind) for kind in SENSOR_KINDS for key in kind_keys(kind)
]
each_key = pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)


def within(bounds):
    return next(x for x in (1.5, 0.5, 45.0, 300.0, 1e5) if bounds.allows(x))


def good(value) -> Any:
    """Return a value that is accepted by a kind of value."""
    match value:
        case values.Number(sampled=True):
            return [within(value.bounds), 30.0]
        case values.Number():
            return within(value.bounds)
        case values.Numbers(of=values.Numbers()):
            return [[0, 0, 0], [1, 1, 0]]
        case values.Numbers():
            one = good(value.of)
            return [one + i for i in range(value.form.count(",") + 1)]
        case values.Whole():
            return value.low
        case values.Word():
            return next(iter(value.words))
        case values.Truth():
            return True
        case values.Table():
            return {}
    return "a name"


def beyond(value):
    """Return values beyond the bounds of a kind of value, and the bounds in words."""
    if isinstance(value, values.Whole):
        return [(value.low - 1, value.form), (value.high + 1, value.form)]
    bounds = getattr(getattr(value, "of", value), "bounds", UNBOUNDED)
    numbers = [bounds.above, bounds.at_least - 1, bounds.at_most + 1]
    outside = [(x, bounds.words()) for x in numbers if abs(x) < float("inf")]
    if isinstance(value, values.Numbers):
        return [([x] * (value.form.count(",") + 1), words) for x, words in outside]
    return outside


@each_key
def test_a_good_value_is_read(case):
    entry = case.entry(good(case.key.value))
    if case.key.name == "times_s":
        entry |= {"records": {"shock_radius_m": "5%"}}
    assert type(case.read(entry)) is UncertainScene
    assert SCHEMA.is_valid(case.document(entry))


@each_key
def test_a_value_of_another_type_is_refused(case):
    entry = case.entry([[]])
    message = case.message(entry)
    assert f" {case.key.name}" in message
    assert "expected " in message
    assert not SCHEMA.is_valid(case.document(entry))


@each_key
def test_a_value_out_of_bounds_is_refused_with_the_bounds(case):
    for value, words in beyond(case.key.value):
        entry = case.entry(value)
        message = case.message(entry)
        assert f" {case.key.name}" in message
        assert words in message
        assert case.kind or not SCHEMA.is_valid(case.document(entry))


@each_key
def test_a_missing_key_is_refused_where_it_is_needed(case):
    entry = case.entry(None)
    if case.key.needed:
        message = case.message(entry)
        assert f" {case.key.name}: expected " in message
        assert message.endswith("got nothing")


@each_key
def test_keys_that_exclude_one_another_and_keys_that_need_another(case):
    name, entry = case.key.name, case.entry(good(case.key.value))
    for words in case.key.instead:
        other = words.split()[0]
        alone = {
            key: value
            for key, value in entry.items()
            if key == name or other not in excluded_by(case.others[key])
        }
        both = alone | {other: good(case.others[other].value)}
        said = f"{name}: expected either {name} or {words}, got both"
        assert said in case.message(both)
    for words in case.key.needs:
        if words.startswith("["):  # a table of the file, in every case
            continue
        without = {k: v for k, v in entry.items() if k != words.split()[0]}
        assert case.message(without).endswith(("got none", "got nothing"))


@each_key
def test_a_misspelt_key_is_refused_with_the_nearest(case):
    message = case.message(case.entry(None) | {f"{case.key.name}x": 1})
    assert f" {case.key.name}x: expected one of " in message
    assert "got an unknown key" in message
    assert "; did you mean " in message


@pytest.mark.parametrize(
    "case",
    [c for c in CASES if c.key.rows],
    ids=lambda case: case.name,
)
def test_a_number_may_be_free_or_have_a_prior(case):
    for i, row in enumerate(case.key.rows):
        middle = within(row.bounds)
        for belief in ("free", {"normal": [middle, middle / 10]}):
            value: Any = good(case.key.value)
            value = (
                [*value[:i], belief, *value[i + 1 :]]
                if row.key.index is not None
                else belief
            )
            (name,) = (
                n
                for n in case.read(case.entry(value)).beliefs
                if n.startswith(row.name)
            )
            assert name.split(".")[0] == row.name
