import contextlib
import os
import signal
from typing import Any

import pytest

import jblast
from jblast.errors import InputError
from jblast.study import run_into, runs
from jblast.study.runs import client_of, shared
from tests.study.example import STUDY, study_in
from tests.study.test_killed import chunks


@contextlib.contextmanager
def workers_here(count):
    """Yield a client of worker processes with one core each."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            dashboard_address=None,  # type: ignore (none)
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
    run_into(study, tmp_path / "one")
    with workers_here(2) as client:

        def on_workers(address, store, missing):
            # a worker is killed with work on it; what it did not end is done again
            pids: Any = client.run(os.getpid)
            for n, states in enumerate(shared(client, store, missing)):
                if n == 2:
                    os.kill(next(iter(pids.values())), signal.SIGKILL)
                yield states

        monkeypatch.setattr(runs, "on_workers", on_workers)
        ran = run_into(study, tmp_path / "two", scheduler="tcp://here")
        with monkeypatch.context() as patch:
            patch.setattr(jblast, "__version__", "9.9")
            (tmp_path / "three").mkdir()
            with pytest.raises(InputError, match="workers: expected jblast"):
                run_into(study, tmp_path / "three", scheduler="tcp://here")
    assert ran.complete
    assert chunks(tmp_path / "one") == chunks(tmp_path / "two")


@pytest.mark.slow
def test_a_scheduler_that_does_not_answer_is_one_message():
    with (
        pytest.raises(InputError, match="expected one that answers"),
        client_of("tcp://127.0.0.1:9"),
    ):
        pass
