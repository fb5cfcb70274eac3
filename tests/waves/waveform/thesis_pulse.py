"""The pulse of the thesis."""

PEAK, DURATION = 2e5, 4e-3
