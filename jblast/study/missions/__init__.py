"""A scene's vehicle on its mission through blasts."""
