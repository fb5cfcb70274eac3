"""Laws of motion found in what was recorded, and judged."""
