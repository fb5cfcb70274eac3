"""Samples that were recorded: files, rates, units, channels; no law is known here."""
