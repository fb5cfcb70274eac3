"""Values of options, and inputs and output files of verbs.

`numbers`, `options` and `logs` are imported before JAX starts; the other modules hold
the work of one or two verbs, and are imported once their options are read.
"""
