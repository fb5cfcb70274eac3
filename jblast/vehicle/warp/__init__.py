"""Flights as Warp kernels: a whole rollout in registers. Imported only for a kernel."""

import warp as wp

wp.config.log_level = wp.LOG_ERROR
"""Warp prints a banner on stdout, which is for results, and warns without a GPU."""
