"""From what recorders wrote to a log, and a scene to start from."""
