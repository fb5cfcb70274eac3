"""Every test runs in float64 with promotions spelled out.

What is compiled is kept in `.jax_cache`, for both workers, the processes that tests
start and the next run; XLA optimises little: tests compile much and compute little.
"""

import contextlib
import ctypes
import gc
import os
import signal
import threading
import zlib
from pathlib import Path

CACHE = Path(__file__).parents[1] / ".jax_cache"
os.environ["XDG_CACHE_HOME"] = str(CACHE)
os.environ.setdefault("MPLBACKEND", "agg")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in commands: half the time
os.environ["JBLAST_KEEP_PROGRAMS"] = "0"  # tests put other numbers into the package

import jax  # noqa: E402 (after what it reads from the environment)
import numpy as np  # noqa: E402
import pytest  # noqa: E402
from jax._src import compilation_cache, core  # noqa: E402
from jax._src.interpreters import mlir  # noqa: E402
from jax._src.lax import lax  # noqa: E402
from jaxlib.mlir import ir  # noqa: E402

pytest_plugins = ["tests.tools.minutes", "tests.tools.two_ends"]

PAGE = os.sysconf("SC_PAGE_SIZE")
FULL = 0.2 * os.sysconf("SC_PHYS_PAGES") * PAGE
"""Bytes that a process may hold before it drops what it compiled; two share them."""


def pytest_sessionstart() -> None:
    # here, since type checks reach only what is imported after pytest is configured
    from jblast.cli.jax_start import start_jax

    start_jax(quick=True)
    reuse_contexts()
    write_quickly()
    copy_arrays()
    hear_ctrl_c()
    jax.config.update("jax_numpy_rank_promotion", "raise")
    jax.config.update("jax_numpy_dtype_promotion", "strict")


def pytest_collection_finish() -> None:
    gc.collect()
    gc.freeze()  # what modules hold stays: it need not be looked through again


def hear_ctrl_c() -> None:
    """Have processes that tests start hear Ctrl-C.

    What a shell without job control starts in the background ignores it, and so does
    whatever that starts.
    """
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def reuse_contexts(uses: int = 100) -> None:
    """Have JAX use an MLIR context more than once, as it does itself from 0.12 on.

    To make one for each of ten thousand programs takes a tenth of the time of all
    tests, and as many are held in memory as there are programs.
    """
    if hasattr(mlir, "_thread_local_context"):
        return
    kept, make = threading.local(), mlir.make_ir_context

    def context():
        if ir.Context.current is not None:  # a program within the making of another
            return make()
        found, left = getattr(kept, "context", (None, 0))
        if not left:
            found, left = make(), uses
        kept.context = found, left - 1
        return found

    mlir.make_ir_context = context  # type: ignore


def write_quickly() -> None:
    """Keep programs packed less tightly, in half the time: there are ten thousand.

    Where another packer than zlib is there, JAX takes that, which is quick by itself.
    """
    others = (getattr(compilation_cache, name, None) for name in ("zstd", "zstandard"))
    if not any(others):
        pack = compilation_cache
        pack.compress_executable = lambda executable: zlib.compress(executable, 1)


def copy_arrays() -> None:
    """Have `jnp.asarray` copy an array of NumPy's, as `jax.device_put` does.

    From JAX 0.10 on it compiles a program for each shape instead, for 15 ms each; tests
    hand over some four hundred. Within another program it is as it was.
    """
    if not hasattr(lax, "stage") or not hasattr(core, "trace_state_clean"):
        return
    stage = lax.stage

    def copied(x):
        if isinstance(x, np.ndarray) and core.trace_state_clean():
            return jax.device_put(x)
        return stage(x)

    lax.stage = copied


@pytest.fixture(autouse=True, scope="module")
def forget_what_was_compiled():
    """Drop compiled programs once there are so many that memory could run out.

    What is freed goes back to the system: else this process would seem full at the end
    of each module from then on, and each would compile everything anew.
    """
    yield
    if held() > FULL:
        jax.clear_caches()
        gc.collect()
        with contextlib.suppress(AttributeError):  # another C library than GNU's
            ctypes.CDLL(None).malloc_trim(0)


def held() -> int:
    """Return the bytes that this process holds in memory; elsewhere than on Linux 0."""
    pages = Path("/proc/self/statm")
    return int(pages.read_text().split()[1]) * PAGE if pages.is_file() else 0
