"""Where flights fail: steps, holds, kernels, pulses."""
