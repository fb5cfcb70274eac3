"""Missions: terminal, document, map, figures."""
