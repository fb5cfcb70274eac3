"""The picture of a fireball, as this camera sees it."""
