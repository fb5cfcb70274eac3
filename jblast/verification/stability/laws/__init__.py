"""Where laws, waveforms, clocks and the shock solver fail."""
