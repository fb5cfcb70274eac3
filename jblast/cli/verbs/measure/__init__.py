"""From what recorders wrote to a log; what the laws say; a scene to start from."""
