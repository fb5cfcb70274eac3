"""One module a verb: `add_arguments` adds its options, `run` returns the exit code.

The docstring of a module is its description in `--help`. A verb is imported to read its
options, so that JAX, NumPy and Matplotlib are imported inside functions only.
"""
