"""Runs that are killed, and go on: what is in the store is that of a whole run."""

import json
import random
import re
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.study import run_into
from jblast.study.columns import read_columns
from jblast.study.engine import store as store_module
from jblast.study.engine.merge import merged
from jblast.study.engine.store import locked, open_store
from jblast.study.sampling import work
from tests.study.example import STUDY, study_in, written

SMALL = 1024
KILLS, TILE_S = 10, 0.2
MANY = STUDY.replace("samples = 300", "samples = 200_000")
CODE = f"""TILE_S = {TILE_S}
import sys, time
from jblast.cli.jax_start import start_jax
start_jax(quick=True)
from jblast.study import read_study, run_into
from jblast.study.sampling import work
work._tile_samples = lambda _: 4096
calculated = work.Work.several
work.Work.several = lambda self, tiles: time.sleep(TILE_S) or calculated(self, tiles)
run_into(read_study(sys.argv[1]), sys.argv[2], resume=True)
"""


def chunks(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in ("zarr.json", ".lock")
    }


def tiles_of(folder):
    """How many tiles there are by now; none where there is no store yet."""
    store = open_store(folder)
    return 0 if store is None else len(store.done())


def opened(folder):
    store = open_store(folder)
    assert store is not None
    return store


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(work, "_tile_samples", lambda _: SMALL)


@pytest.mark.slow
def test_ten_kills_and_a_resume_make_the_store_of_a_whole_run(tmp_path):
    path = written(tmp_path, MANY)
    whole, killed = tmp_path / "whole", tmp_path / "killed"

    def begun(store):
        return subprocess.Popen([sys.executable, "-c", CODE, str(path), str(store)])

    def ended(store):
        with begun(store) as process:
            assert process.wait(300) == 0

    ended(whole)
    draw, tiles = random.Random(0), opened(whole).tiles
    for kill in range(1, KILLS + 1):
        with begun(killed) as process:
            # in the midst of a tile, a tenth of the way further each time
            while tiles_of(killed) < kill * tiles // (KILLS + 1):
                time.sleep(0.02)
                assert process.poll() is None
            time.sleep(draw.uniform(0.0, TILE_S))
            process.send_signal(signal.SIGKILL)
            assert process.wait(60) == -signal.SIGKILL
        store = opened(killed)
        assert len(store.done()) < store.tiles
        assert not store.attributes["complete"]
    ended(killed)
    assert opened(killed).attributes["complete"]
    assert chunks(killed) == chunks(whole)
    names = ("zarr.json", "air_arrival_s/zarr.json")
    assert all((killed / n).read_text() == (whole / n).read_text() for n in names)


def test_a_full_disk_loses_nothing_that_was_computed(tmp_path, monkeypatch, small):
    study = study_in(tmp_path, STUDY.replace("samples = 300", "samples = 2500"))
    run_into(study, tmp_path / "whole")
    written_bytes, left = store_module.write_bytes, [6]

    def full(path, data, **options):
        if left[0] == 0:
            raise OSError(28, "No space left on device")
        left[0] -= 1
        written_bytes(path, data, **options)

    monkeypatch.setattr(store_module, "write_bytes", full)
    with pytest.raises(OSError, match="No space left"):
        run_into(study, tmp_path / "full")
    monkeypatch.setattr(store_module, "write_bytes", written_bytes)
    there = opened(tmp_path / "full")
    assert there.done() == {0}
    assert not there.attributes["complete"]
    ran = run_into(study, tmp_path / "full", resume=True)
    assert ran.new == 2500 - SMALL
    assert chunks(tmp_path / "full") == chunks(tmp_path / "whole")


def flipped(chunk):
    """Change one bit in the middle of a file."""
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 16
    chunk.write_bytes(data)


DAMAGE = {
    "flipped": (flipped, "expected the checksum"),
    "truncated": (lambda chunk: chunk.write_bytes(b"half"), "expected 16,388 bytes"),
    "lost": (lambda chunk: chunk.unlink(), "expected a chunk of the store, got none"),
}


def test_a_damaged_tile_of_a_complete_study_is_named_and_computed_again(
    tmp_path, small
):
    study = study_in(tmp_path, STUDY.replace("samples = 300", "samples = 2500"))
    run_into(study, tmp_path / "store")
    before = chunks(tmp_path / "store")
    for harm, message in DAMAGE.values():
        harm(tmp_path / "store" / "air_arrival_s" / "1.0")
        with pytest.raises(InputError, match=rf"{message}.*\(tile 1\); a resumed"):
            read_columns(str(tmp_path / "store"))
        with pytest.raises(InputError, match=rf"{message}.*\(tile 1\)"):
            merged([tmp_path / "store"], tmp_path / "out")
        ran = run_into(study, tmp_path / "store", resume=True)
        assert (ran.new, ran.complete) == (SMALL, True)
        lost = "got none" in message
        assert lost or message in ran.notes[-1]
        assert lost or ran.notes[-1].startswith("Damaged tile 1, computed again: ")
        assert chunks(tmp_path / "store") == before
    assert read_columns(str(tmp_path / "store")).samples == 2500
    for tile in (0, 2):
        flipped(tmp_path / "store" / "air_arrival_s" / f"{tile}.0")
    with pytest.raises(InputError, match=r"\(tile 0, the first of 2\)"):
        read_columns(str(tmp_path / "store"))


def test_a_damaged_tile_of_statistics_is_named_and_computed_again(tmp_path, small):
    text = STUDY.replace("samples = 300", "samples = 2500") + 'keep = "summary"\n'
    study = study_in(tmp_path, text)
    run_into(study, tmp_path / "store")
    before = chunks(tmp_path / "store")
    for part in ("counts", "moments"):
        chunk = tmp_path / "store" / "summary" / f"air_arrival_s.{part}" / "1.0.0.0"
        flipped(chunk)
        with pytest.raises(InputError, match=rf"{part}.*checksum.*\(tile 1\)"):
            read_columns(str(tmp_path / "store"))
        ran = run_into(study, tmp_path / "store", resume=True)
        assert f"{part}/1.0.0.0: expected the checksum" in ran.notes[-1]
        assert chunks(tmp_path / "store") == before
    flipped(tmp_path / "store" / "summary" / "air_arrival_s.anchor" / "0.0.0")
    with pytest.raises(InputError, match=r"anchor.*expected the checksum"):
        read_columns(str(tmp_path / "store"))
    run_into(study, tmp_path / "store", resume=True)
    assert chunks(tmp_path / "store") == before


def without_checksums(folder):
    """Change a store to the layout of earlier versions."""
    for path in folder.rglob("*"):
        if path.name == "zarr.json":
            text = path.read_text()
            path.write_text(re.sub(r',\s*\{\s*"name": "crc32c"\s*\}', "", text))
        elif path.is_file() and path.name != ".lock":
            path.write_bytes(path.read_bytes()[:-4])


def test_a_store_without_checksums_is_read_and_continued(tmp_path, small):
    study = study_in(tmp_path, STUDY.replace("samples = 300", "samples = 2500"))
    run_into(study, tmp_path / "new", limit=2048)
    shutil.copytree(tmp_path / "new", tmp_path / "old")
    without_checksums(tmp_path / "old")
    old, new = (read_columns(str(tmp_path / name)) for name in ("old", "new"))
    for one, other in zip(old.lanes, new.lanes, strict=True):
        np.testing.assert_array_equal(one.values, other.values)
    assert run_into(study, tmp_path / "old", resume=True).new == 2500 - 2048
    run_into(study, tmp_path / "new", resume=True)
    # its layout stays
    assert {name: data[:-4] for name, data in chunks(tmp_path / "new").items()} == (
        chunks(tmp_path / "old")
    )
    whole = merged([tmp_path / "new", tmp_path / "old"], tmp_path / "out")
    assert whole.attributes["complete"]
    assert chunks(tmp_path / "out") == chunks(tmp_path / "new")


def test_a_store_is_written_by_one_process(tmp_path):
    study = study_in(tmp_path)
    with (
        locked(tmp_path / "store"),
        pytest.raises(InputError, match="expected one process"),
    ):
        run_into(study, tmp_path / "store")


def test_a_store_of_a_newer_schema_and_another_folder_are_refused(tmp_path):
    study = study_in(tmp_path)
    run_into(study, tmp_path / "store")
    group = tmp_path / "store" / "zarr.json"
    said = json.loads(group.read_text())
    said["attributes"]["jblast_study_schema"] = 2
    group.write_text(json.dumps(said))
    with pytest.raises(InputError, match="expected schema 1, got 2"):
        run_into(study, tmp_path / "store", resume=True)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "letter.txt").write_text("dear")
    with pytest.raises(InputError, match="got another folder"):
        run_into(study, tmp_path / "other", resume=True)
