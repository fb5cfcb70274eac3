"""Charges that fill a scene up to a power of two, and never happen."""

from jblast.scene import Charge, Scene
from jblast.world import with_nevers


def test_charges_are_filled_up_to_a_power_of_two_by_some_that_never_happen():
    for count, filled in ((1, 1), (2, 2), (3, 4), (5, 8)):
        charges = [Charge(time_s=1.0 * n, name=str(n)) for n in range(count)]
        scene = with_nevers(Scene(charge=charges[0], others=tuple(charges[1:])))
        assert len(scene.charges) == filled
        assert [charge.name for charge in scene.charges[:count]] == [
            charge.name for charge in charges
        ]
        assert all(bool(charge.never) for charge in scene.charges[count:])
        assert not any(bool(charge.never) for charge in scene.charges[:count])
