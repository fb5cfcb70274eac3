"""The command line `jblast`: one short module a verb."""
