"""From light to events: ideal crossings, the noisy pixel, streams."""
