"""The start of JAX by a command: float64, and compiled code stored between runs."""

import os
from importlib.metadata import version
from pathlib import Path

from jblast.files import write_bytes

QUICK = {
    "0.10": "--xla_cpu_use_fusion_emitters=false",
    "0.11": "--xla_cpu_opt_preset=fast_compile",
    "0.12": "--xla_cpu_opt_preset=fast_compile",
}
"""By version of jaxlib, which aborts at a flag it does not know: of another none."""
UNOPTIMISED = (
    "--xla_backend_optimization_level=0 --xla_cpu_parallel_codegen_split_count=1"
)


def start_jax(*, all_cores: bool = False, quick: bool = False) -> None:
    """Turn on float64 and the compilation cache. The library itself touches neither.

    Args:
        all_cores: Whether each core is a device of its own, among which a batch is
            shared.
        quick: Whether to compile in a third of the time code that takes 1.7 times as
            long to run: for a command that compiles for longer than it computes.
    """
    import atexit
    import contextlib
    import gc

    # Imports and tracing make millions of objects; collecting at Python's pace costs a
    # tenth of an import of JAX and a seventh of a fit, and at the end is for nothing.
    gc.set_threshold(1_000_000)
    atexit.register(gc.freeze)

    if quick:
        _compile_quickly()
    import jax

    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    if all_cores:
        with contextlib.suppress(RuntimeError):  # the devices stand already
            jax.config.update("jax_num_cpu_devices", os.cpu_count() or 1)
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_compilation_cache_dir", str(Path(home) / "jblast"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
    _write_whole()
    if os.environ.get("JBLAST_KEEP_PROGRAMS") != "0":
        from jblast.kept_programs import keep_in

        keep_in(Path(home) / "jblast")


def _compile_quickly() -> None:
    """Ask XLA for little optimisation; what the user asks of it goes before."""
    release = ".".join(version("jaxlib").split(".")[:2])
    wanted = f"{QUICK.get(release, '')} {UNOPTIMISED}".strip()
    flags = os.environ.get("XLA_FLAGS", "")
    if wanted not in flags:
        os.environ["XLA_FLAGS"] = f"{wanted} {flags}".strip()


def _write_whole() -> None:
    """Have JAX give a kept program its name only once it is whole.

    As it stands, another process may read half of one; and what was cut short by a
    kill is read again at every later start, each time with a warning.
    """
    try:
        from jax._src import lru_cache
    except ImportError:  # a JAX that keeps them elsewhere: as it stands there
        return

    def put(cache, key: str, value: bytes) -> None:
        path = cache.path / f"{key}-cache"
        if not path.exists():
            write_bytes(path, value, durable=False)

    setattr(lru_cache.LRUCache, "put", put)  # noqa: B010 (so that types allow it)
