"""Failure modes of each method, measured, and the response of jblast."""
