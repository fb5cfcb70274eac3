"""Samples of a signal: blocks, streams, noise, filters, bits; shared by instruments."""
