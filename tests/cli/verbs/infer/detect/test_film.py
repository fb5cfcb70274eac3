"""`jblast detect` of frames and events: what is told, written and refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from jblast.sensors.camera.files.event_files import write_events
from jblast.sensors.camera.files.images import write_png
from jblast.sensors.camera.pixel import Events
from tests.signals.flash.films import growing

SCENE = """
[camera]
position_m = [0.0, -60.0, 1.5]
look_at_m = [0.0, 0.0, 1.5]
width = {width}
height = 60
focal_px = 100.0
"""


def frames(jblast, name="film", count=60, **film):
    folder = jblast.directory / name
    folder.mkdir()
    _, light = growing(frames=count, **film)
    for number, image in enumerate(light):
        write_png(folder / f"{number:04}.png", image[..., None])
    return str(folder)


def events(jblast, name="film.h5"):
    """Each pixel that the disc reaches is three steps brighter at that moment."""
    times, light = growing(noise=0.0)
    lit = light > 0.6
    first = np.argmax(lit, axis=0)
    y, x = np.nonzero(lit.any(axis=0))
    time = np.repeat(times[first[y, x]] - 2e-4, 3)
    order = np.argsort(time, kind="stable")
    x, y = (np.repeat(v, 3)[order] for v in (x, y))
    ones = np.ones(len(x), int)
    told = Events(x, y, time[order], ones, np.asarray(len(x)), np.asarray(0))
    path = jblast.path(name)
    write_events(path, [told], 80, 60)
    return path


def scene(jblast, width=80, text=SCENE):
    return jblast.file(f"{width}{len(text)}.toml", text.format(width=width))


def test_a_blast_is_told_written_and_exits_with_zero(jblast):
    film, out = frames(jblast), jblast.directory / "out"
    where = ("--scene", scene(jblast), "--out", str(out))
    code, told, _ = jblast("detect", film, "--fps", "1000", *where, "--json")
    assert code == 0
    (flash,) = json.loads(told)["flashes"]
    assert abs(flash["time_s"] - 0.0304) < 4 * flash["sigma_s"]
    # the axis is the middle of the image: (41 - 39.5) / 100 to the right of north
    came = flash["direction"]
    assert came["bearing_rad"] == pytest.approx(0.015, abs=4 * came["bearing_sd_rad"])
    rows = (out / "observations.csv").read_text()
    for quantity in ("flash_time_s", "bearing_rad", "elevation_rad"):
        assert f"\ncamera,{quantity}," in rows
    assert rows.count("fireball_radius_px") == 8
    assert json.loads((out / "detect.json").read_text()) == json.loads(told)
    assert (out / "detection.png").stat().st_size > 1000


def test_events_are_watched_as_frames_are(jblast):
    told = json.loads(jblast("detect", events(jblast), "--json")[1])
    (flash,) = told["flashes"]
    assert told["recording"]["kind"] == "events"
    assert flash["time_s"] == pytest.approx(0.0304, abs=1.5e-3)
    assert (flash["x_px"], flash["y_px"]) == pytest.approx((41.0, 33.0), abs=1.5)


def test_what_cannot_be_is_refused_in_one_line(jblast):
    film = frames(jblast, count=3)
    empty, one = jblast.directory / "empty", jblast.directory / "one"
    empty.mkdir()
    one.mkdir()
    (one / "0.png").write_bytes((Path(film) / "0000.png").read_bytes())
    sound = jblast.file("bang.wav", "")
    for words, said in (
        ((film,), "expected --fps HZ"),
        ((empty, "--fps", 1000), "at least two PNG frames, got 0"),
        ((one, "--fps", 1000), "at least two PNG frames, got 1"),
        ((film, sound), ", without sound;"),
        ((sound, film), ", without sound;"),
        ((film, "--fps", 1000, "--template", sound), "--template: expected it with"),
        (
            (film, "--fps", 1000, "--all-sounds"),
            "--all-sounds: expected it with video or sound only",
        ),
        (("nowhere", "--fps", 1000), "nowhere: no such file or directory"),
        ((film, "--fps", 1000, "--scene", scene(jblast, 90)), "expected 80 x 60"),
        (
            (film, "--fps", 1000, "--scene", scene(jblast, text="")),
            "expected the [camera]",
        ),
        ((jblast.file("a.h5", ""),), "got an empty file"),
        ((jblast.path("none.npz"),), "no such file"),
    ):
        assert said in jblast.refused("detect", *map(str, words))
