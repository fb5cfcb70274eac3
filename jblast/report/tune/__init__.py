"""What a record told of sensors and media, as text, figure, JSON and a scene file."""
