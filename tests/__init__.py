"""Tests mirror the rooms of the package; `tools` drives and times them all."""
