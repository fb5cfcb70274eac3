import contextlib
import os
import signal
from typing import Any

import pytest

import jblast
from jblast.errors import InputError
from jblast.study import run_into
from jblast.study.sampling import work
from jblast.study.sampling.cluster import client_of, shared, write_tile
from tests.study.engine.test_killed import chunks
from tests.study.example import STUDY, study_in


@contextlib.contextmanager
def workers_here(count):
    """Yield a client of worker processes with one core each."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            dashboard_address=None,  # pyright: ignore[reportArgumentType] (none)
            env={"JAX_PLATFORMS": "cpu", "JAX_NUM_CPU_DEVICES": "1"},
            silence_logs=50,  # a worker that was killed
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield client


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of sockets that Dask leaves open
def test_two_processes_write_the_store_that_one_does(tmp_path, monkeypatch):
    study = study_in(tmp_path, STUDY.replace("samples = 300", "samples = 200_000"))
    monkeypatch.setattr(work, "_tile_samples", lambda _: 16_384)
    run_into(study, tmp_path / "one")
    with workers_here(2) as client:
        store = str(tmp_path / "two")

        def by_others(missing):
            for tile in shared(client, write_tile, store, missing[:1], "9.9"):
                yield tile, None

        with pytest.raises(InputError, match="workers: expected jblast"):
            run_into(study, store, tiles=by_others)

        def tiles(missing):
            # a worker is killed with work on it; what it did not end is done again
            pids: Any = client.run(os.getpid)
            for n, tile in enumerate(
                shared(client, write_tile, store, missing, jblast.__version__)
            ):
                if n == 2:
                    os.kill(next(iter(pids.values())), signal.SIGKILL)
                yield tile, None

        ran = run_into(study, store, tiles=tiles, resume=True)
    assert ran.complete
    assert chunks(tmp_path / "one") == chunks(tmp_path / "two")


@pytest.mark.slow
def test_a_scheduler_that_does_not_answer_is_one_message():
    with (
        pytest.raises(InputError, match="expected one that answers"),
        client_of("tcp://127.0.0.1:9"),
    ):
        pass
