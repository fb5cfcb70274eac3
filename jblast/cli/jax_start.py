"""Start of JAX by a command: float64, and a cache of compiled code between runs."""

import os
from importlib.metadata import version

QUICK = {
    "0.10": "--xla_cpu_use_fusion_emitters=false",
    "0.11": "--xla_cpu_opt_preset=fast_compile",
    "0.12": "--xla_cpu_opt_preset=fast_compile",
}
"""Flags of quick compilation, by version of jaxlib.

jaxlib aborts at an unknown flag, so that other versions get none.
"""
# On two cores it breaks even with full compilation at 26 fits of one layout.
UNOPTIMISED = (
    "--xla_backend_optimization_level=0 --xla_cpu_parallel_codegen_split_count=1"
)


def start_jax(*, all_cores: bool = False, quick: bool = False) -> None:
    """Enable float64 and the compilation cache; the library itself changes neither.

    Args:
        all_cores: Whether each core is a device of its own, so that a batch is shared
            among them.
        quick: Whether to compile in a third of the time, for code that takes 1.7 times
            as long to run. A command that compiles for longer than it computes gains.
    """
    import atexit
    import contextlib
    import gc

    # Imports and tracing make millions of objects. Collection at Python's default
    # thresholds costs a tenth of an import of JAX and a seventh of a fit; at exit it
    # frees memory that the system takes back anyway.
    gc.set_threshold(1_000_000)
    atexit.register(gc.freeze)

    if quick:
        release = ".".join(version("jaxlib").split(".")[:2])
        quick_flags = f"{QUICK.get(release, '')} {UNOPTIMISED}".strip()
        flags = os.environ.get("XLA_FLAGS", "")
        # XLA takes the last of two equal flags, so that those of the user prevail
        if quick_flags not in flags:
            os.environ["XLA_FLAGS"] = f"{quick_flags} {flags}".strip()
    import jax

    if all_cores:
        with contextlib.suppress(RuntimeError):  # the devices exist already
            jax.config.update("jax_num_cpu_devices", os.cpu_count() or 1)
    from jblast.kept_programs import (
        CACHE_SETTINGS,
        cache_folder,
        keep_in,
        write_cache_atomically,
    )

    # Arrivals of milliseconds on clocks of days exceed the seven digits of float32.
    jax.config.update("jax_enable_x64", True)
    folder = cache_folder()
    jax.config.update("jax_compilation_cache_dir", str(folder))
    for name, value in CACHE_SETTINGS.items():
        jax.config.update(name, value)
    write_cache_atomically()
    # For laws that depend on something outside of their code, which is not in the key.
    if os.environ.get("JBLAST_KEEP_PROGRAMS") != "0":
        keep_in(folder)
