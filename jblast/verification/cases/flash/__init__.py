"""Film in which detectors of flashes are compared: blasts, and what looks like them."""
