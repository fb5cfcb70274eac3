import numpy as np
from hypothesis import given, strategies

from jblast.sensors.camera.bake.recipe import anchor_px, anchor_share, picture_sides

lengths = strategies.lists(strategies.floats(0.01, 5.0), min_size=3, max_size=3)


@given(reach=lengths, top=lengths, elevation=strategies.floats(0.0, 90.0))
def test_every_frame_holds_the_cloud_in_every_view(reach, top, elevation):
    sides = picture_sides(np.array(reach), np.array(top), np.array([elevation]))
    angle, share = np.radians(elevation), anchor_share(elevation)
    for side, out, up in zip(sides, reach, top, strict=True):
        assert out <= side / 2
        # a cylinder's farthest edges, seen from that elevation
        assert up * np.cos(angle) + out * np.sin(angle) <= share * side
        assert out * np.sin(angle) <= (1.0 - share) * side


@given(reach=lengths, top=lengths)
def test_pictures_never_come_nearer_again(reach, top):
    sides = picture_sides(np.array(reach), np.array(top), np.array([5.0, 60.0]))
    assert (np.diff(sides) >= 0).all()


def test_the_burst_is_low_from_the_side_and_in_the_middle_from_above():
    np.testing.assert_allclose(anchor_px(90.0, 128), (63.5, 63.5), atol=1e-9)
    across, down = anchor_px(0.0, 128)
    assert across == 63.5
    assert 100 < down < 120
