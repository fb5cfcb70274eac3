"""Tasks of a lane: hover, follow rates, fly a mission, detect a blast."""
