"""Where each method breaks, measured, and what jblast does there."""
