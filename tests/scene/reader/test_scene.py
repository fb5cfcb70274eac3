from contextlib import suppress

import jax
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jblast.errors import InputError
from jblast.scene import (
    PARAMETERS,
    Free,
    LogNormal,
    LogUniform,
    Normal,
    UncertainScene,
    Uniform,
    draw_scene,
    read_scene,
)
from jblast.scene.parameters import value_of, with_values
from jblast.scene.reader.scene import scene_from_document
from jblast.scene.reader.schema import KEYS, LATER


@pytest.fixture
def scene(tmp_path):
    def read(content):
        path = tmp_path / "scene.toml"
        data = content if isinstance(content, bytes) else content.encode()
        path.write_bytes(data)
        return read_scene(path)

    return read


FULL = """
schema = 1
[charge]
name = "main"
mass_kg = 15.0
explosive = "TNT"
tnt_factor = { normal = [1.1, 0.1] }
position_m = [1.0, { normal = [2.0, 0.5] }, "free"]
time_s = -0.25
burst = "free-air"
[air]
temperature_k = 290
pressure_pa = 9e4
relative_humidity = 0.25
sound_speed_m_s = { normal = [345.0, 2.0] }
wind_m_s = [3.0, "free"]
[ground]
p_speed_m_s = { lognormal = [5000.0, 1.2] }
path = "thesis"
[[sensor]]
name = "a"
kind = "pressure"
position_m = [20.0, 0, 1.5]
clock_offset_s = 0.5
records = { air_arrival_s = 1e-3, peak_overpressure_pa = 0.05 }
[[sensor]]
name = "b"
clock_offset_s = { normal = [2.0, 0.5] }
[law]
air_arrival_s = "kingery_bulmash"
ground_arrival_s = "auto"
scatter = false
sedov_gamma = { uniform = [1.2, 1.4] }
"""


TWO_CHARGES = """
[[charge]]
name = "first"
mass_kg = 2.0
explosive = "comp b"
[[charge]]
name = "second"
position_m = [5.0, "free", 0.0]
time_s = "free"
burst = "free-air"
"""


def test_several_charges_keep_what_is_theirs_by_name(scene):
    uncertain = scene(TWO_CHARGES)
    first, second = uncertain.scene.charges
    assert (first.name, first.mass, first.explosive) == ("first", 2, "Comp B")
    assert (second.name, second.east, second.burst) == ("second", 5, "free-air")
    assert set(uncertain.beliefs) == {
        "charge_mass_kg.second",
        "charge_north_m.second",
        "origin_time_s.second",
    }
    moved = with_values(uncertain.scene, {"charge_mass_kg.second": 7.0})
    assert (moved.charges[0].mass, moved.charges[1].mass) == (2, 7)


def assert_is(belief, kind, *numbers):
    assert type(belief) is kind
    assert tuple(map(float, vars(belief).values())) == numbers


def test_every_key_of_the_contract_arrives_where_it_belongs(scene):
    uncertain = scene(FULL)
    charge, air = uncertain.scene.charge, uncertain.scene.air
    assert charge.mass == 15
    assert (charge.east, charge.north, charge.up) == (1, 2, 0)
    assert charge.time == -0.25
    assert charge.range is None
    assert charge.burst == "free-air"
    assert charge.tnt_factor == pytest.approx(1.1)
    assert (air.wind_east, air.wind_north) == (3, 0)
    assert uncertain.scene.ground.path == "thesis"
    assert (air.temperature, air.pressure, air.relative_humidity) == (290, 9e4, 0.25)
    assert air.sound_speed == 345
    assert air.altitude is None
    assert uncertain.scene.ground.p_speed == 5000
    a, b = uncertain.scene.sensors
    assert (a.name, a.kind, b.name, b.kind) == ("a", "pressure", "b", "")
    np.testing.assert_array_equal(a.position, [20, 0, 1.5])
    assert (a.clock_offset, b.clock_offset) == (0.5, 2)
    assert a.records == (("air_arrival_s", 1e-3), ("peak_overpressure_pa", 0.05))
    assert np.isnan(b.position).all()
    assert b.records == ()
    assert uncertain.scene.law == (("air_arrival_s", "kingery_bulmash"),)
    assert uncertain.scene.scatter is False
    assert uncertain.scene.sedov_gamma == pytest.approx(1.3)
    assert uncertain.source.endswith("scene.toml")
    beliefs = dict(uncertain.beliefs)
    assert beliefs.pop("charge_up_m") == Free(positive=False)
    assert_is(beliefs.pop("charge_north_m"), Normal, 2, 0.5)
    assert_is(beliefs.pop("air_sound_speed_m_s"), Normal, 345, 2)
    assert_is(beliefs.pop("tnt_factor"), Normal, 1.1, 0.1)
    assert_is(beliefs.pop("clock_offset_s.b"), Normal, 2, 0.5)
    assert beliefs.pop("wind_north_m_s") == Free(positive=False)
    assert_is(beliefs.pop("ground_p_speed_m_s"), LogNormal, 5000, 1.2)
    assert_is(beliefs.pop("sedov_gamma"), Uniform, 1.2, 1.4)
    assert beliefs == {}


def test_a_camera_stays_with_the_scene_whatever_is_drawn(scene):
    camera = (
        "[camera]\nposition_m = [0, -40, 2]\nlook_at_m = [0, 0, 2]\nwidth = 32\n"
        "height = 24\nfocal_px = [30, 31]\nframes_hz = 500\n"
    )
    read = scene("[charge]\nmass_kg = { lognormal = [15, 2] }\n" + camera)
    drawn = draw_scene(jax.random.key(0), read)
    assert float(drawn.charge.mass) != 15.0
    for kept in (read.scene.camera, drawn.camera):
        assert kept is not None
        assert (kept.width, kept.height, float(kept.frames_hz)) == (32, 24, 500.0)
        np.testing.assert_array_equal(kept.focal, [30.0, 31.0])
        np.testing.assert_array_equal(kept.position, [0.0, -40.0, 2.0])
    assert scene("").scene.camera is None


def test_an_empty_file_is_the_default_scene(scene):
    uncertain = scene("")
    assert uncertain.beliefs == {"charge_mass_kg": Free(positive=True)}
    assert uncertain.scene.charge.time == 0
    assert uncertain.scene.charge.burst is None  # the height decides: the surface
    assert uncertain.scene.air.temperature == 288.15
    assert uncertain.scene.air.pressure == 101325
    assert uncertain.scene.air.relative_humidity == 0.5
    assert uncertain.scene.air.sound_speed is None
    assert uncertain.scene.ground.p_speed == 5660
    assert uncertain.scene.sensors == ()
    assert uncertain.scene.scatter is True
    assert uncertain.scene.sedov_gamma == 1.4


ALONE = [one for one in PARAMETERS.values() if one.key.index is None]


@pytest.mark.parametrize("one", ALONE, ids=lambda one: one.name)
def test_every_number_may_be_free(scene, one):
    uncertain = scene(f'[{one.key.table}]\n{one.key.name} = "free"\n')
    assert uncertain.beliefs[one.name] == Free(positive=one.positive)
    assert value_of(uncertain.scene, one.name) == one.default


def test_the_median_of_a_prior_is_where_a_fit_starts(scene):
    uncertain = scene("[charge]\nrange_m = { loguniform = [10, 1000] }\n")
    assert uncertain.scene.charge.range == pytest.approx(100)
    assert_is(uncertain.beliefs["charge_range_m"], LogUniform, 10, 1000)


def test_one_charge_may_be_written_as_a_list(scene):
    uncertain = scene("[[charge]]\nname = 'x'\nmass_kg = 3\n")
    assert uncertain.scene.charge.mass == 3


def test_altitude_stands_in_for_temperature_and_pressure(scene):
    assert scene("[air]\naltitude_m = 1500\n").scene.air.altitude == 1500


def test_a_byte_order_mark_and_windows_line_ends_do_no_harm(scene):
    text = "\ufeff" + FULL.replace("\n", "\r\n")
    assert scene(text).scene.charge.mass == 15


BAD = {
    # what cannot be read at all
    "broken TOML": ("schema = 1\nmass = = 2\n", ["broken TOML", "line 2"]),
    "key twice": ("[air]\npressure_pa = 1\npressure_pa = 2\n", ["broken TOML"]),
    "a number of 5000 digits": ("schema = " + "9" * 5000, ["broken TOML"]),
    "deep nesting": ("schema = " + "[" * 5000, ["broken TOML"]),
    "Latin-1": (b"# caf\xe9\n", ["line 1", "UTF-8", "0xe9"]),
    "binary": (b"schema = 1\n\0\0", ["line 2", "a scene in TOML", "0x00"]),
    # keys
    "unknown key": (
        "[charge]\nmas_kg = 1\n",
        ["[charge] mas_kg", "unknown key", "did you mean mass_kg?", "burst"],
    ),
    "unknown table": ("[chrage]\n", ["chrage", "unknown table", "mean charge?"]),
    "unknown key of a sensor": (
        "[[sensor]]\nnam = 'a'\n",
        ["[[sensor]] nam", "did you mean name?"],
    ),
    "unknown quantity under law": (
        "[law]\nair_arival_s = 'wu_hao'\n",
        ["[law] air_arival_s", "did you mean air_arrival_s?"],
    ),
    "a later schema": ("schema = 2\n", ["schema", "expected 1", "got 2"]),
    "a table that is a number": ("air = 5\n", ["[air]", "written [air]", "got 5"]),
    "one sensor as a table": ("[sensor]\nname='a'\n", ["written [[sensor]]"]),
    "charges that are numbers": ("charge = [1]\n", ["[[charge]]", "got [1]"]),
    "no charge": ("charge = []\n", ["[[charge]]", "empty list"]),
    # not built yet
    "mission": (
        "[vehicle]\nmission = 'x.plan'\n",
        ["[vehicle] mission", "not supported yet"],
    ),
    "world": ("[world]\n", ["[world]", "not supported yet"]),
    "explosive": (
        "[charge]\nexplosive = 'ANFOO'\n",
        ["[charge] explosive", "unknown explosive 'ANFOO'", "mean ANFO?", "Comp B"],
    ),
    "explosive that is no text": ("[charge]\nexplosive = 3\n", ["in quotes", "got 3"]),
    "ground path": ("[ground]\npath = 'tunnel'\n", ["[ground] path", "head, thesis"]),
    "later law": (
        "[law]\nair_arrival_s = 'euler'\n",
        ["[law] air_arrival_s", "not supported yet"],
    ),
    "free sensor": (
        "[[sensor]]\nname = 'a'\nposition_m = ['free', 0, 0]\n",
        ["'a' position_m", "not supported yet"],
    ),
    "microphone": (
        "[[sensor]]\nname = 'a'\nrate_hz = 48000\n",
        ["[[sensor]] rate_hz", "not supported yet"],
    ),
    # what excludes another
    "explosive and factor": (
        "[charge]\nexplosive = 'C4'\ntnt_factor = 1.1\n",
        ["[charge] tnt_factor", "got both"],
    ),
    "charges without a name": (
        "[[charge]]\nname = 'a'\n[[charge]]\n",
        ["[[charge]] name", "charge 2 of 2", "got nothing"],
    ),
    "charges of one name": (
        "[[charge]]\nname = 'a'\n[[charge]]\nname = 'a'\n",
        ["[[charge]] 'a' name", "each name once"],
    ),
    "altitude and pressure": (
        "[air]\naltitude_m = 0\npressure_pa = 1e5\n",
        ["[air] altitude_m", "pressure_pa", "got both"],
    ),
    "altitude and temperature": (
        "[air]\naltitude_m = 0\ntemperature_k = 280\n",
        ["[air] altitude_m", "temperature_k", "got both"],
    ),
    "range and position": (
        "[charge]\nrange_m = 3\nposition_m = [0, 0, 0]\n",
        ["[charge] range_m", "either range_m or position_m", "got both"],
    ),
    "range to two sensors": (
        "[charge]\nrange_m = 3\n[[sensor]]\nname = 'a'\n[[sensor]]\nname = 'b'\n",
        ["[charge] range_m", "one sensor", "got 2"],
    ),
    # numbers
    "negative mass": (
        "[charge]\nmass_kg = -15\n",
        ["[charge] mass_kg", "a number that is positive", "got -15"],
    ),
    "zero range": ("[charge]\nrange_m = 0\n", ["range_m", "positive", "got 0"]),
    "cold": ("[air]\ntemperature_k = 15\n", ["between 150 and 400", "got 15"]),
    "per cent": ("[air]\nrelative_humidity = 50\n", ["between 0 and 1", "got 50"]),
    "above the troposphere": ("[air]\naltitude_m = 2e4\n", ["altitude_m", "11000"]),
    "gamma": ("[law]\nsedov_gamma = 1.0\n", ["sedov_gamma", "above 1", "got 1.0"]),
    "never": (
        "[charge]\ntime_s = inf\n",
        ["[charge] time_s: expected a finite number", "never happens out of the file"],
    ),
    "infinite": ("[charge]\ntime_s = -inf\n", ["time_s", "a finite number", "-inf"]),
    "not a number": ("[charge]\nmass_kg = nan\n", ["a finite number", "got nan"]),
    "overflow": ("[charge]\nmass_kg = 1" + "0" * 400, ["a finite number", "..."]),
    "text": ("[charge]\nmass_kg = '15'\n", ['a number, "free" or', "got '15'"]),
    "truth": ("[charge]\nmass_kg = true\n", ["a number", "got True"]),
    "a date": ("[charge]\ntime_s = 2020-01-01\n", ["a number", "datetime"]),
    "two coordinates": (
        "[charge]\nposition_m = [0, 0]\n",
        ["[charge] position_m", "[east, north, up]", "got [0, 0]"],
    ),
    "a bad coordinate": (
        "[charge]\nposition_m = [0, 'x', 0]\n",
        ["[charge] position_m[1]", "got 'x'"],
    ),
    "a storm": ("[air]\nwind_m_s = [0, 300]\n", ["[air] wind_m_s[1]", "got 300"]),
    "no TNT": ("[charge]\ntnt_factor = 0\n", ["tnt_factor", "positive", "got 0"]),
    "three winds": ("[air]\nwind_m_s = [0, 0, 0]\n", ["[east, north]"]),
    # priors
    "lo > hi": (
        "[charge]\nmass_kg = { uniform = [2, 1] }\n",
        ["[charge] mass_kg", "lo < hi", "got [2, 1]"],
    ),
    "lo = hi": ("[charge]\nmass_kg = { loguniform = [1, 1] }\n", ["lo < hi"]),
    "factor": (
        "[charge]\nmass_kg = { lognormal = [2, 1] }\n",
        ["a factor above 1", "got [2, 1]"],
    ),
    "sd": ("[charge]\ntime_s = { normal = [2, 0] }\n", ["a positive sd", "[2, 0]"]),
    "median": (
        "[charge]\ntime_s = { lognormal = [0, 2] }\n",
        ["a positive median", "[0, 2]"],
    ),
    "log of a negative": (
        "[charge]\ntime_s = { loguniform = [-1, 2] }\n",
        ["a positive lo", "[-1, 2]"],
    ),
    "a uniform that reaches zero": (
        "[charge]\nmass_kg = { uniform = [0, 2] }\n",
        ["[charge] mass_kg", "an end that is positive", "got 0"],
    ),
    "a normal about a negative mass": (
        "[charge]\nmass_kg = { normal = [-1, 2] }\n",
        ["a mean that is positive", "got -1"],
    ),
    "unknown prior": (
        "[charge]\nmass_kg = { gaussian = [1, 2] }\n",
        ["[charge] mass_kg", "unknown prior 'gaussian'", "lognormal, normal"],
    ),
    "misspelt prior": (
        "[charge]\nmass_kg = { log_normal = [1, 2] }\n",
        ["did you mean lognormal?"],
    ),
    "two priors": (
        "[charge]\nmass_kg = { normal = [1, 2], uniform = [1, 2] }\n",
        ["got normal and uniform"],
    ),
    "no prior": ("[charge]\nmass_kg = {}\n", ["got an empty table"]),
    "half a prior": (
        "[charge]\nmass_kg = { normal = [1] }\n",
        ["expected normal = [mean, sd]", "got [1]"],
    ),
    "a prior of words": (
        "[charge]\nmass_kg = { normal = ['a', 2] }\n",
        ["two finite numbers in normal", "got 'a'"],
    ),
    "a prior of infinity": (
        "[charge]\nmass_kg = { uniform = [1, inf] }\n",
        ["two finite numbers in uniform", "got inf"],
    ),
    # words
    "burst": ("[charge]\nburst = 'air'\n", ["[charge] burst", "surface, free-air"]),
    "path": ("[ground]\npath = 'hed'\n", ["[ground] path", "did you mean head?"]),
    "charge without name": ("[charge]\nname = ''\n", ["[charge] name", "a name"]),
    "explosive number": ("[charge]\nexplosive = 3\n", ["explosive", "got 3"]),
    "negative TNT factor": ("[charge]\ntnt_factor = -1\n", ["positive", "got -1"]),
    "law number": ("[law]\nair_arrival_s = 1\n", ["[law] air_arrival_s", "got 1"]),
    "scatter": ("[law]\nscatter = 1\n", ["[law] scatter", "true or false", "got 1"]),
    # sensors
    "sensor without name": (
        "[[sensor]]\nname = 'a'\n[[sensor]]\n",
        ["[[sensor]] name", "sensor 2", "got nothing"],
    ),
    "sensors of one name": (
        "[[sensor]]\nname = 'a'\n[[sensor]]\nname = 'a'\n",
        ["[[sensor]] name", "'a' twice"],
    ),
    "sensor kind": (
        "[[sensor]]\nname = 'a'\nkind = 'mic'\n",
        ["[[sensor]] 'a' kind", "microphone", "got 'mic'"],
    ),
    "sensor place": (
        "[[sensor]]\nname = 'a'\nposition_m = [0, nan, 0]\n",
        ["[[sensor]] 'a' position_m[1]", "finite", "got nan"],
    ),
    "sensor place of two": (
        "[[sensor]]\nname = 'a'\nposition_m = [0, 0]\n",
        ["[[sensor]] 'a' position_m", "[east, north, up]", "got [0, 0]"],
    ),
    "records of an unknown quantity": (
        "[[sensor]]\nname = 'a'\nrecords = { air_arrival = 1 }\n",
        ["'a' records", "unknown quantity", "did you mean air_arrival_s?"],
    ),
    "records without sigma": (
        "[[sensor]]\nname = 'a'\nrecords = { air_arrival_s = 0 }\n",
        ["'a' records air_arrival_s", "a positive sigma", "got 0"],
    ),
    "records of words": (
        "[[sensor]]\nname = 'a'\nrecords = 'air_arrival_s'\n",
        ["'a' records", "QUANTITY = sigma"],
    ),
}


@pytest.mark.parametrize(("content", "said"), BAD.values(), ids=BAD.keys())
def test_bad_input_is_told_by_file_key_expectation_and_find(scene, content, said):
    with pytest.raises(InputError) as caught:
        scene(content)
    message = str(caught.value)
    assert "scene.toml: " in message
    for words in said:
        assert words in message, message
    assert "\n" not in message


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(InputError, match=r"none\.toml: no such file; expected a scene"):
        read_scene(tmp_path / "none.toml")
    with pytest.raises(InputError, match="is a directory"):
        read_scene(tmp_path)


NUMBER = st.one_of(
    st.floats(),
    st.integers(),
    st.just("free"),
    st.dictionaries(
        st.sampled_from(["normal", "lognormal", "uniform", "loguniform", "x"]),
        st.lists(st.floats(), max_size=3),
        max_size=2,
    ),
)
VALUE = st.recursive(
    st.one_of(st.none(), st.booleans(), NUMBER, st.text(max_size=8)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.dictionaries(st.text(max_size=8), inner, max_size=2),
    ),
    max_leaves=6,
)


def tables(name):
    keys = st.sampled_from([*KEYS[name], *LATER.get(name, ()), "x"])
    some = st.one_of(NUMBER, st.lists(NUMBER, min_size=3, max_size=3), VALUE)
    return st.dictionaries(keys, some, max_size=4)


CAMERA = {
    "position_m": [0.0, -40.0, 2.0],
    "look_at_m": [0.0, 0.0, 2.0],
    "width": 32,
    "height": 24,
    "focal_px": 30.0,
}

VEHICLE = {"model": "iris", "position_m": [10.0, 0.0, 2.0]}
CONTROL = st.one_of(tables("control"), VALUE)

DOCUMENT = st.fixed_dictionaries(
    {},
    optional={
        "schema": st.one_of(st.just(1), VALUE),
        "charge": st.one_of(tables("charge"), VALUE),
        "air": st.one_of(tables("air"), VALUE),
        "ground": st.one_of(tables("ground"), VALUE),
        "law": st.one_of(tables("law"), VALUE),
        "sensor": st.one_of(st.lists(tables("sensor"), max_size=3), VALUE),
        "camera": st.one_of(tables("camera").map(lambda t: CAMERA | t), VALUE),
        "vehicle": st.one_of(
            tables("vehicle").map(lambda t: VEHICLE | t),
            CONTROL.map(lambda control: VEHICLE | {"control": control}),
            VALUE,
        ),
        "x": VALUE,
    },
)


@settings(deadline=None)
@given(DOCUMENT)
def test_random_documents_raise_nothing_but_input_errors(document):
    with suppress(InputError):
        assert type(scene_from_document(document, "scene.toml")) is UncertainScene


@settings(deadline=None)
@given(NUMBER, st.sampled_from(ALONE))
def test_what_is_accepted_lies_within_its_bounds(value, one):
    document = {one.key.table: {one.key.name: value}}
    with suppress(InputError):
        uncertain = scene_from_document(document, "scene.toml")
        start = value_of(uncertain.scene, one.name)
        assert start is not None
        assert one.bounds.allows(start.item())
