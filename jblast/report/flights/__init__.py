"""Flights: terminal, document, figures."""
