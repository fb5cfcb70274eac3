"""`jblast render --sun --bloom`."""

import numpy as np
import pytest

from jblast.sensors.camera import read_events
from jblast.sensors.camera.files.images import read_png
from tests.cli.verbs.simulate.render.scenes import refused, rendered

SHORT = ("--times", "2.0:2.006", "--fps", "250", "--force")


def last_frame(jblast):
    return read_png(jblast.directory / "out" / "frames" / "0001.png").astype(int)


def events(jblast):
    sent = read_events(jblast.directory / "out" / "events.h5")
    return {name: np.asarray(getattr(sent, name)) for name in "txyp"}


@pytest.mark.slow
def test_bloom_spreads_frames_and_leaves_events_as_they_are(jblast):
    rendered(jblast, *SHORT, "--noise", "off")
    sharp, sent = last_frame(jblast), events(jblast)
    rendered(jblast, *SHORT, "--noise", "off", "--bloom", "0.3")
    assert (last_frame(jblast) != sharp).any()
    assert len(sent["t"])
    for name, values in events(jblast).items():
        np.testing.assert_array_equal(values, sent[name])
    rendered(jblast, *SHORT, "--mode", "rgb", "--bloom", "0")
    np.testing.assert_array_equal(last_frame(jblast), sharp)


def test_a_sun_brightens_the_sky(jblast):
    frames = []
    for words in ((), ("--sun", "0,20")):
        rendered(jblast, *SHORT, "--mode", "rgb", "--background", "sky", *words)
        frames.append(last_frame(jblast))
    assert (frames[1] >= frames[0]).all()
    assert (frames[1][0] > frames[0][0]).any()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--sun", "0,20"), "--sun: expected --background sky or --ground with it"),
        (("--sun", "0,20", "--background", "0.2"), "got '0.2'"),
        (("--sun", "0,-1", "--background", "sky"), "--sun: expected AZIMUTH,ELEVATION"),
        (("--sun", "south", "--background", "sky"), "--sun: expected AZIMUTH"),
        (("--bloom", "1.5"), "--bloom: expected a share"),
        (("--bloom", "nan"), "--bloom: expected a share"),
    ],
)
def test_what_cannot_be_is_refused(jblast, words, message):
    assert message in refused(jblast, *words)
