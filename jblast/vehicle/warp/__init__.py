"""Flights as Warp kernels: a whole rollout in registers. Imported only for a kernel."""

import warp as wp

wp.config.log_level = wp.LOG_ERROR
"""It greets on stdout, where an answer may stand, and warns where there is no GPU."""
