"""Flights as kernels of Warp. Imported only when one is asked for."""

import warp as wp

wp.config.log_level = wp.LOG_ERROR
"""It greets on stdout, where an answer may stand, and warns where there is no GPU."""
