"""Sedov and Taylor: the strong point explosion, and its constant."""
