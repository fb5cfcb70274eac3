"""Fits of records' samples."""
