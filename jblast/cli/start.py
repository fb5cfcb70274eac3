"""How a command starts JAX: float64, and compiled code kept between runs."""

import os
from pathlib import Path


def start_jax() -> None:
    """Turn on float64 and the compilation cache. The library itself touches neither."""
    import gc

    import jax

    # Tracing makes millions of short-lived objects; collecting them at Python's pace
    # costs a seventh of a fit.
    gc.set_threshold(1_000_000)

    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_compilation_cache_dir", str(Path(home) / "jblast"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
