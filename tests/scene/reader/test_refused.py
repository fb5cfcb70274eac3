"""What a scene file must not say is told by file, key, expectation and find."""

import pytest

from jblast.errors import InputError
from jblast.scene import read_scene

BAD = {
    # what cannot be read at all
    "broken TOML": ("schema = 1\nmass = = 2\n", ["broken TOML", "line 2"]),
    "deep nesting": ("schema = " + "[" * 5000, ["broken TOML"]),
    "Latin-1": (b"# caf\xe9\n", ["line 1", "UTF-8", "0xe9"]),
    "binary": (b"schema = 1\n\0\0", ["line 2", "a scene in TOML", "0x00"]),
    # keys
    "unknown key": (
        "[charge]\nmas_kg = 1\n",
        ["[charge] mas_kg", "unknown key", "did you mean mass_kg?", "burst"],
    ),
    "unknown table": ("[chrage]\n", ["chrage", "unknown table", "mean charge?"]),
    "unknown quantity under law": (
        "[law]\nair_arival_s = 'wu_hao'\n",
        ["[law] air_arival_s", "did you mean air_arrival_s?"],
    ),
    "a later schema": ("schema = 2\n", ["schema", "expected 1", "got 2"]),
    "a table that is a number": ("air = 5\n", ["[air]", "written [air]", "got 5"]),
    "one sensor as a table": ("[sensor]\nname='a'\n", ["written [[sensor]]"]),
    "no charge": ("charge = []\n", ["[[charge]]", "empty list"]),
    "world": (
        "[world]\n",
        ["[world]", "expected single blasts", "random", "jblast world"],
    ),
    "explosive": (
        "[charge]\nexplosive = 'ANFOO'\n",
        ["[charge] explosive", "unknown explosive 'ANFOO'", "mean ANFO?", "Comp B"],
    ),
    "ground path": ("[ground]\npath = 'tunnel'\n", ["[ground] path", "head, thesis"]),
    "free sensor": (
        "[[sensor]]\nname = 'a'\nposition_m = ['free', 0, 0]\n",
        ["'a' position_m", "not supported yet"],
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
    "hectopascals": (
        "[air]\npressure_pa = 1013\n",
        ["[air] pressure_pa", "between 20000 and 120000", "1013 hPa is 101300"],
    ),
    "a prior up to no pressure": (
        "[air]\npressure_pa = { uniform = [1e3, 1e5] }\n",
        ["[air] pressure_pa", "a bound", "between 20000 and 120000", "got 1000"],
    ),
    "above the troposphere": ("[air]\naltitude_m = 2e4\n", ["altitude_m", "11000"]),
    "gamma": ("[law]\nsedov_gamma = 1.0\n", ["sedov_gamma", "above 1", "got 1.0"]),
    "never": (
        "[charge]\ntime_s = inf\n",
        [
            "[charge] time_s: expected a finite number",
            "omit a charge that never happens",
        ],
    ),
    "not a number": ("[charge]\nmass_kg = nan\n", ["a finite number", "got nan"]),
    "text": ("[charge]\nmass_kg = '15'\n", ['a number, "free" or', "got '15'"]),
    "truth": ("[charge]\nmass_kg = true\n", ["a number", "got True"]),
    "two coordinates": (
        "[charge]\nposition_m = [0, 0]\n",
        ["[charge] position_m", "[east, north, up]", "got [0, 0]"],
    ),
    "three winds": ("[air]\nwind_m_s = [0, 0, 0]\n", ["[east, north]"]),
    # priors
    "lo > hi": (
        "[charge]\nmass_kg = { uniform = [2, 1] }\n",
        ["[charge] mass_kg", "lo < hi", "got [2, 1]"],
    ),
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
        ["[charge] mass_kg", "a bound that is positive", "got 0"],
    ),
    "a normal about a negative mass": (
        "[charge]\nmass_kg = { normal = [-1, 2] }\n",
        ["a mean that is positive", "got -1"],
    ),
    "unknown prior": (
        "[charge]\nmass_kg = { gaussian = [1, 2] }\n",
        ["[charge] mass_kg", "unknown prior 'gaussian'", "lognormal, normal"],
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
    # words
    "burst": ("[charge]\nburst = 'air'\n", ["[charge] burst", "surface, free-air"]),
    "charge without name": ("[charge]\nname = ''\n", ["[charge] name", "a name"]),
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
    "records of an unknown quantity": (
        "[[sensor]]\nname = 'a'\nrecords = { air_arrival = 1 }\n",
        ["'a' records", "unknown quantity", "did you mean air_arrival_s?"],
    ),
    "records without sigma": (
        "[[sensor]]\nname = 'a'\nrecords = { air_arrival_s = 0 }\n",
        ["'a' records air_arrival_s", "a positive sigma", "got 0"],
    ),
    "a plain number where a share is meant": (
        "[[sensor]]\nname = 'a'\nrecords = { peak_overpressure_pa = 0.05 }\n",
        ["share of the value", "got 0.05", "multiply by 100", '"5%"', "in Pa"],
    ),
    "a share of a time": (
        "[[sensor]]\nname = 'a'\nrecords = { air_arrival_s = '5%' }\n",
        ["'a' records air_arrival_s", "sigma in seconds", "got '5%'"],
    ),
    "a share of nothing": (
        "[[sensor]]\nname = 'a'\nrecords = { positive_duration_s = '0%' }\n",
        ["'a' records positive_duration_s", "positive share", "got '0%'"],
    ),
    "a share without its sign": (
        "[[sensor]]\nname = 'a'\nrecords = { positive_duration_s = '5' }\n",
        ["'a' records positive_duration_s", 'its % sign, as "5%"', "got '5'"],
    ),
    "a mass in pounds": (
        "[charge]\nmass_lb = 33\n",
        ["[charge] mass_lb", "ours is mass_kg: multiply by 0.45359237"],
    ),
    "a temperature in Celsius": (
        "[air]\ntemperature_c = 15\n",
        ["[air] temperature_c", "ours is temperature_k: add 273.15"],
    ),
    "a humidity in per cent": (
        "[air]\nrelative_humidity_percent = 50\n",
        ["ours is relative_humidity, a share: multiply by 0.01"],
    ),
    "a pressure that is milli or mega": (
        "[air]\npressure_mpa = 0.1\n",
        ["ours is pressure_pa", "MPa or mPa"],
    ),
    "an arrival in milliseconds": (
        "[[sensor]]\nname = 'a'\nrecords = { air_arrival_ms = 1 }\n",
        ["'a' records", "ours is air_arrival_s: multiply by 0.001"],
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
