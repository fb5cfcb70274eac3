"""Stores put together: no sample counts twice."""

import shutil

import pytest

from jblast.errors import InputError
from jblast.study import run_into
from jblast.study.engine.merge import merged
from jblast.study.sampling import work
from tests.study.example import STUDY, study_in


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """Stores of two seeds as they would be, in tiles of 64 samples of 300."""
    folder = tmp_path_factory.mktemp("kept")
    study = study_in(folder, STUDY.replace("seed = 7", "seed = 1"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(work, "_tile_samples", lambda _: 64)
        run_into(study, folder / "seed_1")
    group = shutil.copytree(folder / "seed_1", folder / "seed_2") / "zarr.json"
    text = group.read_text().replace("seed = 1", "seed = 2")
    group.write_text(text.replace('"seed": 1', '"seed": 2'))
    return folder


@pytest.fixture
def stores(kept, tmp_path):
    return shutil.copytree(kept, tmp_path / "stores")


def test_a_store_is_not_merged_with_itself(stores):
    (stores / "link").symlink_to(stores / "seed_1")
    for other in (stores / "seed_1", stores / "." / "seed_1", stores / "link"):
        with pytest.raises(InputError, match="expected each store once"):
            merged([stores / "seed_1", other], stores / "out")
    assert not (stores / "out").exists()


def test_tiles_that_two_stores_have_count_once(stores):
    shutil.copytree(stores / "seed_1", stores / "copy")
    whole = merged([stores / "seed_1", stores / "copy"], stores / "out")
    assert whole.attributes["samples"] == 300
    assert whole.attributes["complete"]


def test_a_study_with_another_seed_is_refused(stores):
    with pytest.raises(InputError, match="got another study"):
        merged([stores / "seed_1", stores / "seed_2"], stores / "out")
    assert not (stores / "out").exists()
