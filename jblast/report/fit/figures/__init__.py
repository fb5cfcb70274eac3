"""Figures of a fit: recordings, residuals, the posterior."""
