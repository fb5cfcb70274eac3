"""Where on the Earth a scene is, and its recorders' clocks."""

import pytest

from jblast.errors import InputError
from jblast.scene import Free, Normal, Place
from jblast.scene.reader.scene import scene_from_document

PLACE = {"lat_deg": 33.9, "lon_deg": 35.5, "alt_m": 10}


def read(**tables):
    return scene_from_document(tables, "scene.toml")


def test_a_place_is_read_and_its_height_may_be_left_out():
    assert read(place=PLACE).place == Place(33.9, 35.5, 10.0)
    assert read(place={"lat_deg": -90, "lon_deg": 360}).place == Place(-90, 360, 0)
    assert read().place is None


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"lat_deg": 135.2}, r"\[place\] lat_deg: .*got 135.2; are lat_deg and"),
        ({"lon_deg": -181}, r"\[place\] lon_deg: expected a number"),
        ({"alt_m": "free"}, r"\[place\] alt_m: .*not supported yet"),
        ({"height_m": 1}, r"\[place\] height_m: unknown key"),
    ],
)
def test_what_is_no_place_is_refused(change, said):
    with pytest.raises(InputError, match=said):
        read(place=PLACE | change)
    with pytest.raises(InputError, match="lon_deg: expected a number, got nothing"):
        read(place={"lat_deg": 33.9})


def test_clocks_are_fixed_free_or_uncertain():
    entries = [
        {"name": "a", "offset_s": 0.5},
        {"name": "b", "offset_s": "free"},
        {"name": "c", "offset_s": {"normal": [0.1, 2]}},
        {"name": "d"},
    ]
    uncertain = read(clock=entries)
    offsets = {name: float(x) for name, x in uncertain.scene.clock_offsets().items()}
    assert offsets == pytest.approx({"a": 0.5, "b": 0.0, "c": 0.1, "d": 0.0})
    beliefs = {name: type(x) for name, x in uncertain.beliefs.items()}
    del beliefs["charge_mass_kg"]
    assert beliefs == {"clock_offset_s.b": Free, "clock_offset_s.c": Normal}


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"clock": [{"offset_s": 1}]}, r"\[\[clock\]\] name: expected a name"),
        ({"clock": [{"name": "a"}, {"name": "a"}]}, "each name once"),
        ({"clock": [{"name": "a", "offset_s": "x"}]}, "'a' offset_s: expected"),
        ({"clock": [{"name": "a", "offset": 1}]}, "did you mean offset_s"),
        (
            {"clock": [{"name": "a"}], "sensor": [{"name": "a", "clock_offset_s": 1}]},
            r"\[\[sensor\]\] of that name has a clock_offset_s",
        ),
    ],
)
def test_what_is_no_clock_is_refused(tables, said):
    with pytest.raises(InputError, match=said):
        read(**tables)
