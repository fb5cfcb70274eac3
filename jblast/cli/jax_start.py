"""The start of JAX by a command: float64, and compiled code stored between runs."""

import os
from importlib.metadata import version

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

    if all_cores:
        with contextlib.suppress(RuntimeError):  # the devices stand already
            jax.config.update("jax_num_cpu_devices", os.cpu_count() or 1)
    from jblast.kept_programs import CACHE_SETTINGS, cache_folder, keep_in, write_whole

    jax.config.update("jax_enable_x64", True)
    folder = cache_folder()
    jax.config.update("jax_compilation_cache_dir", str(folder))
    for name, value in CACHE_SETTINGS.items():
        jax.config.update(name, value)
    write_whole()
    if os.environ.get("JBLAST_KEEP_PROGRAMS") != "0":
        keep_in(folder)


def _compile_quickly() -> None:
    """Ask XLA for little optimisation; what the user asks of it goes before."""
    release = ".".join(version("jaxlib").split(".")[:2])
    wanted = f"{QUICK.get(release, '')} {UNOPTIMISED}".strip()
    flags = os.environ.get("XLA_FLAGS", "")
    if wanted not in flags:
        os.environ["XLA_FLAGS"] = f"{wanted} {flags}".strip()
