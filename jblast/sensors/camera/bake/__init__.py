"""Sets of views of an explosion: simulated, rendered and written down."""
