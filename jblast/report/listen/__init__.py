"""What `jblast listen` writes: samples, the truth behind them, and pictures of both."""
