"""What a lane is to do: hover, follow rates, fly a mission, tell a blast."""
