"""Stores put together: no sample counts twice."""

import json
import shutil

import pytest

from jblast.errors import InputError
from jblast.study import run_into
from jblast.study.engine.merge import merged
from jblast.study.engine.store import open_store
from jblast.study.sampling import work
from tests.study.example import STUDY, study_in


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """Stores of three seeds as they would be, in tiles of 64 samples of 300."""
    folder = tmp_path_factory.mktemp("kept")
    study = study_in(folder, STUDY.replace("seed = 7", "seed = 1"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(work, "_tile_samples", lambda _: 64)
        run_into(study, folder / "seed_1")
    for seed in (2, 3):
        group = (
            shutil.copytree(folder / "seed_1", folder / f"seed_{seed}") / "zarr.json"
        )
        text = group.read_text().replace("seed = 1", f"seed = {seed}")
        group.write_text(text.replace('"seed": 1', f'"seed": {seed}'))
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


def test_other_seeds_follow_one_another_once_each(stores):
    two = merged([stores / "seed_1", stores / "seed_2"], stores / "two")
    assert two.attributes["samples"] == 600
    three = merged([stores / "two", stores / "seed_3"], stores / "three")
    assert three.attributes["samples"] == 900
    assert three.attributes["seeds"] == [1, 2, 3]


@pytest.mark.parametrize("again", ["seed_1", "seed_2"])
def test_a_seed_that_is_in_already_is_refused(stores, again):
    merged([stores / "seed_1", stores / "seed_2"], stores / "two")
    with pytest.raises(InputError, match="no sample counts twice"):
        merged([stores / "two", stores / again], stores / "out")
    assert not (stores / "out").exists()


def test_a_seed_in_a_table_is_no_seed_of_the_study(stores):
    for folder, number in (("seed_1", 3), ("seed_2", 4)):
        group = stores / folder / "zarr.json"
        content = json.loads(group.read_text())
        content["attributes"]["study"] += f"[options]\nseed = {number}\n"
        group.write_text(json.dumps(content))
    with pytest.raises(InputError, match="got another study"):
        merged([stores / "seed_1", stores / "seed_2"], stores / "out")


@pytest.mark.parametrize("name", ["²", "٠"])
def test_files_with_digits_of_other_scripts_are_no_chunks(stores, name):
    folder = stores / "seed_1"
    store = open_store(folder)
    assert store is not None
    before = store.done()
    for variable in store.variables:
        chunk = store.chunk_path(variable, 0)
        chunk.rename(chunk.with_name(chunk.name.replace("0", name, 1)))
    assert store.done() == before - {0}
