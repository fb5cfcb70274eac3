import json

import pytest

from tests.cli.cli_files import SENSORS

PRIOR = "[charge]\nmass_kg = { lognormal = [15.0, 3.0] }\n"


@pytest.mark.slow
def test_what_is_simulated_is_fitted_back_for_several_seeds(jblast):
    scene = jblast.file("truth.toml", PRIOR + SENSORS)
    seeds = range(6)
    off = []
    for seed in seeds:
        log = jblast.path(f"{seed}.csv")
        assert jblast("simulate", scene, "--out", log, "--seed", str(seed))[0] == 0
        text = jblast.text(f"{seed}.csv")
        assert "SIMULATED" in text
        (truth,) = [x for x in text.splitlines() if "truth: charge_mass_kg" in x]
        code, out, _ = jblast(
            "fit", log, "--free", "charge_mass_kg", "--law", "kingery_bulmash", "--json"
        )
        answer = json.loads(out)
        # a seed may draw so small a charge that the law is extrapolated
        assert code == (4 if answer["extrapolated"] else 0)
        mass = answer["estimates"]["charge_mass_kg"]
        off.append(not mass["q05"] < float(truth.split("=")[1]) < mass["q95"])
    # each misses with a chance of 0.1: three or more of six in one case of 63
    assert sum(off) <= 2


def test_a_seed_decides_every_draw(jblast):
    scene = jblast.file("truth.toml", PRIOR + SENSORS)
    text = []
    for name, seed in (("a", "7"), ("b", "7"), ("c", "8")):
        out = jblast.path(name)
        assert jblast("simulate", scene, "--out", out, "--seed", seed)[0] == 0
        text.append(
            [x for x in jblast.text(name).splitlines() if not x.startswith("#")]
        )
    assert text[0] == text[1]
    assert text[0] != text[2]


def test_what_cannot_be_simulated_exits_2(jblast, tmp_path):
    good = jblast.file("good.toml", "[charge]\nmass_kg = 15.0\n" + SENSORS)
    free = "bad.toml: charge_mass_kg: expected a value or a prior, got a number that is"
    cases = {
        '[charge]\nmass_kg = "free"\n' + SENSORS: free,
        SENSORS: free,  # an absent mass is
        "[charge]\nmass_kg = 15.0\n": "no sensor records anything",
        '[charge]\nmass_kg = 15.0\n[[sensor]]\nname = "a"\n'
        "records = { air_arrival_s = 1e-3 }\n": "position_m",
    }
    for content, word in cases.items():
        scene = jblast.file("bad.toml", content)
        assert word in jblast.refused("simulate", scene, "--out", jblast.path("o.csv"))
    normal = "[charge]\nmass_kg = { normal = [1e-3, 8.0] }\n" + SENSORS
    scene = jblast.file("bad.toml", normal)
    refusal = jblast.refused("simulate", scene, "--out", jblast.path("o.csv"))
    assert "sd above zero" in refusal
    assert not (tmp_path / "o.csv").exists()
    err = jblast.refused("simulate", good, "--out", jblast.path("no/o.csv"))
    assert "cannot be written" in err
    assert "exists already" in jblast.refused("simulate", good, "--out", good)
    assert "--out" in jblast.refused("simulate", good)
    for seed in ("x", "-1", "1" + 30 * "0"):
        err = jblast.refused("simulate", good, "--out", "o.csv", "--seed", seed)
        assert "whole number" in err
