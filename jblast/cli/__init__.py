"""The command `jblast`: one file a verb, each thin."""
