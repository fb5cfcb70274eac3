"""State, equations of motion, and the integrators that step them."""
