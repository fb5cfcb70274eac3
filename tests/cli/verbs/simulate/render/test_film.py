"""`jblast render`: frames, events and what is said of them."""

import json
import shutil

import h5py
import numpy as np
import pytest
from PIL import Image

from jblast.sensors.camera.files import images
from tests.cli.verbs.simulate.render.scenes import (
    AWAY,
    CAMERA,
    CHARGE,
    refused,
    rendered,
)
from tests.sensors.camera.rendering.baked.noise_set import write_noise_set


def events_in(path: str) -> dict[str, np.ndarray]:
    with h5py.File(path) as file:
        return {name: np.asarray(file[f"events/{name}"]) for name in "xytp"}


@pytest.mark.slow
def test_frames_events_and_a_contact_sheet(jblast):
    said = rendered(jblast, "--seconds", "0.04")
    assert (said["frames"], said["width"], said["height"]) == (20, 24, 18)
    assert (said["start_s"], said["fps"], said["threshold"]) == (2.0, 500, [0.2, 0.3])
    assert said["duration_s"] == pytest.approx(0.038)
    frames = sorted((jblast.directory / "out" / "frames").iterdir())
    assert [path.name for path in frames] == [f"{k:04d}.png" for k in range(20)]
    first, second = (np.asarray(Image.open(path)) for path in frames[:2])
    assert first.shape == (18, 24, 3)
    assert (first == 118).all()  # sRGB of the grey of 0.18; the burst is now
    assert second.max() == 255
    events = events_in(said["files"]["events"])
    assert len(events["t"]) == said["events"] == said["brighter"] + said["darker"] > 50
    assert 0 < events["t"].min() < events["t"].max() <= 38_000
    # the blast is ahead, a little below the middle
    assert abs(np.median(events["x"]) - 11.5) < 1
    assert images.read_png(said["files"]["contact_sheet"]).shape[1] > 100


@pytest.mark.slow
def test_times_of_events_owe_nothing_to_the_frame_rate(jblast):
    answers = []
    for fps in ("26", "101"):
        said = rendered(jblast, "--times", "2:2.1", "--fps", fps, "--force")
        assert (said["stamps"], said["stamp_error_s"]) == ("interpolated", 1e-6)
        answers.append(events_in(said["files"]["events"]))
    slow, fast = answers
    both = min(slow["t"].max(), fast["t"].max())  # their last frames differ
    slow, fast = ({n: v[e["t"] <= both] for n, v in e.items()} for e in answers)
    orders = [np.lexsort((e["t"], e["p"], e["x"], e["y"])) for e in (slow, fast)]
    assert len(slow["t"]) > 50
    for name in "xyp":
        np.testing.assert_array_equal(slow[name][orders[0]], fast[name][orders[1]])
    # each is rounded to a microsecond
    off = slow["t"][orders[0]] - fast["t"][orders[1]]
    assert np.abs(off).max() <= 1


@pytest.mark.slow
def test_events_of_a_world_are_those_of_its_film(jblast):
    """The same pixels and signs; all but 1 % of the times within the bound of runs."""
    scene = jblast.file("scene.toml", CHARGE.replace("2.0", "0.1") + CAMERA)
    film = rendered(jblast, "--times", "0:0.3", "--views", "explosion")
    words = ("world", scene, "--seconds", "0.3", "--out", jblast.path("run"), "--json")
    code, out, err = jblast(*words)
    assert (code, err) == (0, "")
    files = film["files"]["events"], jblast.path("run/camera/events.h5")
    known, found = map(events_in, files)
    last = 1e6 * film["duration_s"]  # a run ends an interval later
    found = {name: v[found["t"] <= last] for name, v in found.items()}
    assert len(known["t"]) > 500
    orders = [np.lexsort((e["t"], e["p"], e["x"], e["y"])) for e in (known, found)]
    for name in "xyp":
        np.testing.assert_array_equal(known[name][orders[0]], found[name][orders[1]])
    times = [
        1.0 * e["t"][order] for e, order in zip((known, found), orders, strict=True)
    ]
    off = np.abs(times[0] - times[1])
    assert np.quantile(off, 0.99) < 1e6 * json.loads(out)["camera"]["stamp_error_s"]


@pytest.mark.slow
def test_modes_write_what_they_say(jblast):
    both = rendered(jblast, "--seconds", "0.02")
    kept = events_in(both["files"]["events"])
    frames = {
        p.name: p.read_bytes() for p in (jblast.directory / "out/frames").iterdir()
    }
    for mode, written in (("rgb", "frames"), ("events", "events.h5")):
        shutil.rmtree(jblast.directory / "out")
        said = rendered(jblast, "--seconds", "0.02", "--mode", mode)
        names = {path.name for path in (jblast.directory / "out").iterdir()}
        assert names == {written, "contact_sheet.png"}
        assert set(said["files"]) == {written.removesuffix(".h5"), "contact_sheet"}
        if mode == "rgb":
            for name, data in frames.items():
                assert (jblast.directory / "out/frames" / name).read_bytes() == data
        else:
            for name, column in events_in(said["files"]["events"]).items():
                np.testing.assert_array_equal(column, kept[name])


def test_times_are_those_asked_for(jblast):
    said = rendered(jblast, "--times", "1.99:2.01", "--fps", "1000", "--mode", "rgb")
    assert (said["start_s"], said["frames"]) == (1.99, 20)
    frames = sorted((jblast.directory / "out" / "frames").iterdir())
    changed = [not (np.asarray(Image.open(p)) == 118).all() for p in frames]
    assert changed == [False] * 11 + [True] * 9  # at 2 s it has no size yet
    said = rendered(jblast, "--times", "-0.01:0.01", "--mode", "rgb", "--force")
    assert (said["start_s"], said["frames"]) == (-0.01, 10)


def test_the_default_lasts_until_no_fireball_glows(jblast):
    said = rendered(jblast, "--fps", "100", "--mode", "rgb")
    # 0.258 * 15^0.349 s
    assert said["frames"] == 67
    jblast.file("scene.toml", CHARGE.replace("15.0", "1e6") + CAMERA)
    said = rendered(jblast, "--force", "--mode", "rgb", "--fps", "4000")
    assert said["frames"] == 1000
    assert len(list((jblast.directory / "out" / "frames").iterdir())) == 1000


@pytest.mark.slow
def test_priors_are_drawn_and_repeat_with_the_seed(jblast):
    prior = CHARGE.replace("15.0", "{ lognormal = [15.0, 2.0] }")
    jblast.file("scene.toml", prior + CAMERA)
    counts = [
        rendered(jblast, "--seconds", "0.02", "--seed", seed, "--force")["events"]
        for seed in ("0", "0", "1")
    ]
    assert counts[0] == counts[1] != counts[2]


VIEWS = """frames_hz = 100.0
charge_mass_kg = 15.0
metres_per_pixel = 0.5
[[view]]
frames = "south"
azimuth_deg = 180.0
"""


def test_pictures_may_stand_for_the_fireball(jblast):
    folder = jblast.directory / "views" / "south"
    folder.mkdir(parents=True)
    for k in range(3):
        picture = np.zeros((21, 21, 4), np.uint8)
        # larger than what a pixel of the film, 3.3 of these, smooths at its edge
        picture[3:18, 3:18] = [0, 80 * (k + 1), 0, 255]
        Image.fromarray(picture).save(folder / f"{k}.png")
    words = ["--views", jblast.path("views"), "--mode", "rgb", "--force"]
    assert "expected a directory of views with views.toml, got no index" in refused(
        jblast, *words
    )
    jblast.file("views/views.toml", VIEWS)
    said = rendered(jblast, *words)
    assert said["frames"] == 15  # three pictures of 10 ms at 500 Hz
    image = np.asarray(Image.open(jblast.path("out/frames/0005.png")))
    np.testing.assert_array_equal(image[10, 11:13], [[0, 160, 0]] * 2)
    assert (image[0] == 118).all()


def test_a_camera_may_look_away_at_a_background_that_moves(jblast):
    jblast.file("scene.toml", CHARGE + AWAY)
    (jblast.directory / "behind").mkdir()
    for k in range(5):
        image = np.full((18, 24, 3), 40 * k + 30, np.uint8)
        Image.fromarray(image).save(jblast.directory / "behind" / f"{k}.png")
    words = ["--seconds", "0.01", "--background", jblast.path("behind")]
    words += ["--flash", "off"]  # the ground before it is lit from behind
    said = rendered(jblast, *words)
    assert said["events"] > 18 * 24
    frame = np.asarray(Image.open(jblast.path("out/frames/0003.png")))
    assert (frame == 150).all()


@pytest.mark.slow
def test_an_explosion_set_stands_in_the_place_of_the_ball(jblast, tmp_path):
    folder = write_noise_set(tmp_path / "set", views=[(180.0, 5.0), (0.0, 40.0)])
    high = CHARGE.replace("[0, 0, 1]", "[0, 0, 4]") + CAMERA
    jblast.file("scene.toml", high)
    words = ["--seconds", "0.04", "--views", str(folder)]
    said = rendered(jblast, *words)
    # the largest radius is 4.46 m, and the picture stands half of it below the burst
    assert said["lifted_m"] == pytest.approx(4.0 - 0.5 * 1.81 * 15 ** (1 / 3))
    assert said["events"] > 50
    last = np.asarray(Image.open(jblast.directory / "out" / "frames" / "0019.png"))
    assert last.max() == 255
    code, text, _ = jblast(
        *("render", jblast.path("scene.toml"), "--out", jblast.path("again")),
        *(*words, "--mode", "rgb"),
    )
    assert code == 0
    assert "drawn at a height of 1.77 m" in text
