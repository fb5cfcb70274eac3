"""The command line `jblast`: one module a verb, each thin."""
