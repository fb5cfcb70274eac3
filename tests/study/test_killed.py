"""Runs that are killed, and go on: what is in the store is that of a whole run."""

import dataclasses
import json
import random
import signal
import subprocess
import sys
import time

import pytest

from jblast.errors import InputError
from jblast.study import run_into
from jblast.study.columns import read_columns
from jblast.study.outcome.family import FAMILIES
from jblast.study.store import MOMENTS, Store, locked, opened_store
from tests.study.example import STUDY, study_in, written

SMALL = 1024
KILLS, SLAB_S = 10, 0.2
MANY = STUDY.replace("samples = 300", "samples = 60_000")
LONG = STUDY.replace("samples = 300", "samples = 2500")
CODE = f"""SLAB_S = {SLAB_S}
import sys, time
from jblast.cli.jax_start import start_jax
start_jax(quick=True)
from jblast.study import read_study, run_into
from dataclasses import replace
from jblast.study.outcome.family import FAMILIES
FAMILIES["quantities"] = replace(FAMILIES["quantities"], block=2048, on_core=1)
from jblast.study.slabs import Slabs
compute = Slabs.compute
Slabs.compute = lambda *how: time.sleep(SLAB_S) or compute(*how)
run_into(read_study(sys.argv[1]), sys.argv[2], resume=True)
"""


def chunks(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != "zarr.json"
    }


def slabs_of(folder):
    """Return the number of slabs whose last file is there."""
    return len([*(folder / MOMENTS / "air_arrival_s").glob("*.0")])


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
    draw, slabs = random.Random(0), opened_store(whole).slabs
    for kill in range(1, KILLS + 1):
        with begun(killed) as process:
            # in the midst of a slab, a tenth of the way further each time
            while slabs_of(killed) < kill * slabs // (KILLS + 1):
                time.sleep(0.02)
                assert process.poll() is None
            time.sleep(draw.uniform(0.0, SLAB_S))
            process.send_signal(signal.SIGKILL)
            assert process.wait(60) == -signal.SIGKILL
        assert slabs_of(killed) < slabs
        assert not opened_store(killed).attributes["complete"]
    ended(killed)
    assert opened_store(killed).attributes["complete"]
    assert chunks(killed) == chunks(whole)
    names = ("zarr.json", "air_arrival_s/zarr.json")
    assert all((killed / n).read_text() == (whole / n).read_text() for n in names)


def test_a_full_disk_loses_nothing_that_was_computed(tmp_path, monkeypatch):
    study = study_in(tmp_path, LONG)
    run_into(study, tmp_path / "whole")
    written_slab = Store.write

    def full(self, n, columns, states):
        if n == 1:
            raise OSError(28, "No space left on device")
        written_slab(self, n, columns, states)

    with monkeypatch.context() as patch:
        patch.setattr(Store, "write", full)
        with pytest.raises(OSError, match="No space left"):
            run_into(study, tmp_path / "full")
    there = opened_store(tmp_path / "full")
    assert there.states(0) is not None
    assert there.states(1) is None
    assert not there.attributes["complete"]
    assert run_into(study, tmp_path / "full", resume=True).complete
    assert chunks(tmp_path / "full") == chunks(tmp_path / "whole")


@pytest.fixture(autouse=True)
def thousands(monkeypatch):
    """Slabs of 1,024 draws."""
    few = dataclasses.replace(FAMILIES["quantities"], block=SMALL, on_core=1)
    monkeypatch.setitem(FAMILIES, "quantities", few)


def flipped(chunk):
    """Change one bit in the middle of a file."""
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 16
    chunk.write_bytes(data)


DAMAGE = {
    "flipped": flipped,
    "truncated": lambda chunk: chunk.write_bytes(b"half"),
    "lost": lambda chunk: chunk.unlink(),
}


@pytest.mark.parametrize("harm", DAMAGE)
@pytest.mark.parametrize("name", ["air_arrival_s/1.0", "moments/air_arrival_s/1.0.0"])
def test_a_damaged_slab_of_a_complete_study_is_named_and_computed_again(
    tmp_path, harm, name
):
    study, store = study_in(tmp_path, LONG), tmp_path / "store"
    run_into(study, store)
    before = chunks(store)
    DAMAGE[harm](store / name)
    with pytest.raises(InputError, match=r"slab 1: .*a resumed"):
        read_columns(str(store))
    ran = run_into(study, store, resume=True)
    assert (ran.new, ran.complete) == (SMALL, True)
    noted = ran.notes[-1].startswith("Damaged slab 1, computed again: ")
    assert noted == (harm != "lost")
    assert chunks(store) == before
    assert read_columns(str(store)).samples == 2500


def test_a_larger_number_of_samples_continues_a_study(tmp_path):
    study = study_in(tmp_path, LONG)
    run_into(study, tmp_path / "whole")
    run_into(dataclasses.replace(study, samples=1500), tmp_path / "grown")
    ran = run_into(study, tmp_path / "grown", resume=True)
    # the second slab had 476 draws of 1,024
    assert (ran.new, ran.complete) == (2500 - SMALL, True)
    assert chunks(tmp_path / "grown") == chunks(tmp_path / "whole")
    with pytest.raises(InputError, match="samples was 2500, is 300"):
        run_into(
            dataclasses.replace(study, samples=300), tmp_path / "grown", resume=True
        )


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
    said["attributes"]["jblast_study_schema"] = 3
    group.write_text(json.dumps(said))
    with pytest.raises(InputError, match="expected schema 2, got 3"):
        run_into(study, tmp_path / "store", resume=True)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "letter.txt").write_text("dear")
    with pytest.raises(InputError, match="got another folder"):
        run_into(study, tmp_path / "other", resume=True)
