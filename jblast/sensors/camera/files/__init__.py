"""Frames, events and views as files."""
