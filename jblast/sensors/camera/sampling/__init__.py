"""From where to look: directions spread evenly over the upper hemisphere."""
