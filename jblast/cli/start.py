"""How a command starts JAX: float64, and compiled code kept between runs."""

import os
from pathlib import Path


def start_jax(*, all_cores: bool = False) -> None:
    """Turn on float64 and the compilation cache. The library itself touches neither.

    Args:
        all_cores: Whether each core is a device of its own, among which a batch is
            shared.
    """
    import contextlib
    import gc

    import jax

    # Tracing makes millions of short-lived objects; collecting them at Python's pace
    # costs a seventh of a fit.
    gc.set_threshold(1_000_000)

    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    if all_cores:
        with contextlib.suppress(RuntimeError):  # the devices stand already
            jax.config.update("jax_num_cpu_devices", os.cpu_count() or 1)
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_compilation_cache_dir", str(Path(home) / "jblast"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
