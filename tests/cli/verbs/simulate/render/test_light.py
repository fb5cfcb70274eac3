"""`jblast render --depth --daylight --flash`."""

import numpy as np
import pytest

from jblast.sensors.camera import read_events
from jblast.sensors.camera.files.images import read_png
from tests.cli.verbs.simulate.render.scenes import rendered

SHORT = ("--times", "2.0:2.006", "--mode", "rgb", "--fps", "250")


def last_frame(jblast):
    return read_png(jblast.directory / "out" / "frames" / "0001.png").astype(int)


@pytest.mark.slow
def test_fire_lights_the_ground_more_at_dusk_and_not_at_all_if_told_so(jblast):
    frames = []
    for words in (("--flash", "off"), (), ("--daylight", "1000")):
        rendered(jblast, *SHORT, "--force", *words)
        frames.append(last_frame(jblast).sum(axis=(1, 2)))
    dark, day, dusk = (int(rows[-4:].sum()) for rows in frames)  # the ground's rows
    assert dark < day < dusk


@pytest.mark.slow  # a program with a wall
def test_a_wall_hides_the_fire_in_frames_and_events(jblast):
    wall = jblast.directory / "wall.npy"
    np.save(wall, np.full((18, 24), 10.0))
    words = ("--times", "2.0:2.006", "--depth", str(wall), "--flash", "off")
    document = rendered(jblast, *words)
    assert document["events"] == 0
    assert np.ptp(last_frame(jblast)) == 0


@pytest.mark.slow
def test_the_sky_follows_the_daylight_and_its_events_do_not(jblast):
    skies, sent = [], []
    for lux in ("94000", "1000", "10"):
        words = ("--times", "2.0:2.006", "--fps", "250", "--background", "sky")
        rendered(jblast, *words, "--daylight", lux, "--noise", "off", "--force")
        skies.append(last_frame(jblast)[0].mean())
        sent.append(len(read_events(jblast.directory / "out" / "events.h5").t))
    # linear light is shown 0.81 and 0.37 times as bright
    assert skies[0] > skies[1] + 10 > skies[2] + 40
    # the fire is brighter beside a darker day: more events, whatever the picture
    assert sent[0] < sent[1] < sent[2]
