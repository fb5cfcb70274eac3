"""A recorder whose clock is off: the answer names it, a scene of `scene` frees it."""

import json

import pytest

from jblast.observations import read, to_pandas

SCENE = """[charge]
mass_kg = 20.0
position_m = [10.0, -5.0, 0.0]
[law]
scatter = false
"""
PLACES = {
    "a": (300.0, 0.0, 0.0),
    "b": (0.0, 400.0, 0.0),
    "c": (-500.0, 20.0, 2.0),
    "d": (60.0, -220.0, 2.0),
    "e": (-400.0, -500.0, 0.0),
}
"""East and north of each, and by how much its clock is off."""


def log_of(jblast):
    """Simulate a log in which two of five share a clock that is 2 s late."""
    scene = SCENE + "".join(
        f"[[sensor]]\nname = {name!r}\nposition_m = [{east}, {north}, 2.0]\n"
        f"clock_offset_s = {late}\n"
        'records = { air_arrival_s = 2e-3, peak_overpressure_pa = "5%" }\n'
        for name, (east, north, late) in PLACES.items()
    )
    path = jblast.path("simulated.csv")
    words = ("simulate", jblast.file("truth.toml", scene), "--out", path)
    assert jblast(*words, "--seed", "3")[0] == 0
    frame = to_pandas(read(path))
    late = frame["sensor"].map(lambda name: PLACES[name][2] > 0)
    frame["clock"] = late.map({True: "phone_1", False: ""})
    frame.to_csv(jblast.path("log.csv"), index=False)
    return jblast.path("log.csv")


@pytest.mark.slow  # fits of four layouts are compiled
def test_a_clock_that_is_off_is_named_and_freed_by_the_scene_that_scene_writes(jblast):
    log = log_of(jblast)
    code, out, _ = jblast("fit", log, "--json")
    assert code == 4
    assert any(
        "--free clock_offset_s.phone_1" in w for w in json.loads(out)["warnings"]
    )
    scene = jblast.path("s.toml")
    assert jblast("scene", log, "--out", scene)[0] == 0
    written = jblast.text("s.toml")
    lines = ("[[clock]]  # if it does not agree", 'name = "phone_1"', 'offset_s = "')
    for line in lines:
        assert f"# {line}" in written
        written = written.replace(f"# {line}", line)
    for filled in ('"free"', "{ normal = [0, 2] }"):
        path = jblast.file(
            "filled.toml", written.replace('s = "free"  # its', f"s = {filled}  # its")
        )
        code, out, err = jblast("fit", log, "--scene", path, "--json")
        assert code == 0, err
        told = json.loads(out)["estimates"]
        assert told["clock_offset_s.phone_1"]["q05"] < 2.0
        assert told["clock_offset_s.phone_1"]["q95"] > 2.0
        assert told["charge_mass_kg"]["q05"] < 20.0 < told["charge_mass_kg"]["q95"]
