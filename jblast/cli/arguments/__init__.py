"""Values of options, and inputs and output files of verbs.

`verb_parser`, `numbers`, `options` and `logs` are imported before JAX starts. The other
modules do the work of one or two verbs, and are imported once their options are read.
"""
