"""`jblast detect` of several clips: one log, which `jblast fit` accepts."""

import json

import numpy as np
import pytest

from jblast.observations import read
from tests.signals.flash.films import growing
from tests.test_mutations_of_files import clip

PLACES = {"one": (60.0, 0.0), "two": (0.0, 75.0), "three": (-50.0, -50.0)}
CHARGE = np.array([5.0, 10.0])
FLASHES = dict(zip(PLACES, (0.4, 0.45, 0.5), strict=True))
BANGS = {
    name: FLASHES[name] + np.linalg.norm(place - CHARGE) / 340.29
    for name, place in PLACES.items()
}
SCENE = """
[charge]
mass_kg = 0.001
position_m = ["free", "free", 0.0]
time_s = "free"

[law]
air_arrival_s = "acoustic"
scatter = false
"""


@pytest.fixture
def clips(jblast):
    """Clips of a second with a fireball, and a pulse of 8 ms in noise."""
    rng, paths = np.random.default_rng(0), []
    for name in PLACES:
        film = {"burst_s": FLASHES[name], "tau": 0.05, "noise": 0.003, "frames": 30}
        after = np.arange(48000) / 48000 - BANGS[name]
        x = np.maximum(after, 0.0) / 0.008
        sound = 0.5 * (after >= 0) * (1.0 - x) * np.exp(-x)
        sound += 1e-3 * rng.standard_normal(48000)
        path = jblast.directory / f"{name}.mp4"
        paths.append(str(clip(path, growing(rate=30.0, **film)[1], sound)))
    return paths


@pytest.mark.slow
def test_clips_make_one_log_of_their_own_clocks_and_a_fit_finds_the_charge(
    jblast, clips
):
    rows = "".join(f"{name},{x},{y},0\n" for name, (x, y) in PLACES.items())
    table = jblast.file("stations.csv", f"sensor,east_m,north_m,up_m\n{rows}")
    words = (*clips, "--positions", table, "--out", jblast.path("out"))
    code, told, err = jblast("detect", *words)
    assert code == 0, err
    clocks = "clock_offset_s.two,clock_offset_s.three"
    assert told.splitlines()[-1].startswith("Fit it with: jblast fit ")
    answers = json.loads((jblast.directory / "out/detect.json").read_text())["clips"]
    log = read(jblast.path("out/observations.csv"))
    assert log.sensor == log.clock == tuple(name for name in PLACES for _ in range(2))
    assert log.quantity == ("flash_time_s", "air_arrival_s") * 3
    printed = [one["arrivals"][0]["sigma_s"] for one in answers]
    np.testing.assert_allclose(log.sigma[::2], np.hypot(printed, 1 / 30 / np.sqrt(12)))
    assert "offset of sound and picture" in log.comments[-1]
    # the encoder's echo before the front spoils the picks: their times are the search's
    early = log.value[1::2] - [*BANGS.values()]
    assert (np.abs(early) < 3 * log.sigma[1::2]).all()
    assert log.sigma[1::2].max() < 3e-3
    errors = log.value[::2] - [*FLASHES.values()]
    assert (np.abs(errors) < 4 * log.sigma[::2]).all()
    scene = jblast.file("scene.toml", SCENE)
    words = (jblast.path("out/observations.csv"), "--scene", scene, "--free", clocks)
    code, out, err = jblast("fit", *words, "--json")
    assert code == 0, err
    estimates = json.loads(out)["estimates"]
    for name, truth in zip(("charge_east_m", "charge_north_m"), CHARGE, strict=True):
        assert abs(estimates[name]["value"] - truth) < 4 * estimates[name]["sd"], name
