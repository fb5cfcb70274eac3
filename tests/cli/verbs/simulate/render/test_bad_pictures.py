"""Sets of views and videos that are broken: one line that names the file, exit 2."""

import numpy as np
import pytest
from PIL import Image

from tests.cli.verbs.simulate.render.scenes import refused
from tests.sensors.camera.files.made_video import flat, make_video

INDEX = """frames_hz = 30.0
metres_per_pixel = 0.05
charge_mass_kg = 5.0
[[view]]
frames = "south"
azimuth_deg = 180.0
"""


def picture(path, size=(6, 4), mode="RGBA"):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.zeros((size[1], size[0], 4), np.uint8)).convert(mode).save(path)


def cut(path, share=0.5):
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])


OWN = {
    "a frame missing": (
        lambda d: (d / "south/0001.png").unlink(),
        "set/south: expected frame 1 after 0000.png, got 0002.png",
    ),
    "another size": (
        lambda d: picture(d / "south/0001.png", size=(5, 5)),
        "set/south/0001.png: expected 6 x 4 pixels",
    ),
    "no alpha": (
        lambda d: picture(d / "south/0001.png", mode="RGB"),
        "set/south/0001.png: expected a frame with alpha (RGBA)",
    ),
    "cut short": (
        lambda d: cut(d / "south/0001.png"),
        "set/south/0001.png: expected a",
    ),
    "no index": (
        lambda d: (d / "views.toml").unlink(),
        "set: expected a directory of views with views.toml, got no index",
    ),
    "from below alone": (
        lambda d: (d / "views.toml").write_text(INDEX + "elevation_deg = -20\n"),
        "set/views.toml: elevation_deg: expected views from above the ground",
    ),
}


@pytest.mark.parametrize(("spoil", "said"), OWN.values(), ids=OWN)
def test_a_set_of_ones_own_that_is_broken_is_refused_by_name(jblast, spoil, said):
    folder = jblast.directory / "set"
    for k in range(4):
        picture(folder / f"south/{k:04d}.png")
    (folder / "views.toml").write_text(INDEX)
    spoil(folder)
    assert said in refused(jblast, "--seconds", "0.01", "--views", str(folder))


@pytest.mark.parametrize("verb", ["render", "detect", "events"])
def test_a_video_that_breaks_off_or_varies_is_refused_by_name(jblast, verb):
    short = make_video(jblast.directory / "short.mp4", flat(*range(16, 46)))
    cut(short, 0.6)
    stamps = [0, 20, 40, 60, 80, 180, 200, 220]
    varies = make_video(
        jblast.directory / "varies.mp4", flat(*range(20, 28)), stamps=stamps
    )
    for path, said in (
        (short, "short.mp4: expected a complete video"),
        (varies, "varies.mp4: expected a constant frame rate"),
    ):
        if verb == "render":
            words = ["--seconds", "0.01", "--background", str(path)]
            assert said in refused(jblast, *words)
            continue
        if verb == "detect" and path == varies:  # it goes by the stamps of the file
            continue
        out = ["--out", jblast.path("out.h5")] if verb == "events" else []
        message = jblast.refused(verb, str(path), *out)
        assert said in message
        assert message.count("\n") == 1
