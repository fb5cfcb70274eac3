"""What a walk keeps in its folder, and what is refused there; nothing is compiled."""

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference.mcmc.engines import Segment
from jblast.inference.mcmc.run import Store


def stretch(steps, value=0.0):
    random = {"key": np.arange(4, dtype=np.uint32)}
    return Segment(np.full((steps, 3, 2), value), np.full((steps, 3), -value), random)


@pytest.fixture
def store(tmp_path):
    kept = Store(tmp_path / "chain")
    kept.begin({"names": np.array(["charge_mass_kg"])})
    return kept


def test_stretches_come_back_in_order_and_whole(store):
    store.keep(5, stretch(3, 2.0))
    store.keep(0, stretch(5, 1.0))
    first, second = store.segments()
    np.testing.assert_array_equal(first.chain, stretch(5, 1.0).chain)
    np.testing.assert_array_equal(second.log_density, stretch(3, 2.0).log_density)
    np.testing.assert_array_equal(second.random["key"], np.arange(4))
    assert store.about()["names"].tolist() == ["charge_mass_kg"]


def test_a_missing_stretch_is_told_with_the_step_it_began_at(store):
    store.keep(0, stretch(5))
    store.keep(9, stretch(2))
    with pytest.raises(InputError, match="begins after step 5, got another"):
        store.segments()


def test_a_foreign_file_in_the_place_of_a_stretch_is_refused(store):
    np.savez(store.folder / "steps-00000000.npz", chain=np.zeros((5, 3, 2)))
    with pytest.raises(InputError, match="missing, or is of another chain"):
        store.segments()
    (store.folder / "steps-00000000.npz").write_bytes(b"PK")
    with pytest.raises(InputError, match="damaged or of another kind"):
        store.segments()
