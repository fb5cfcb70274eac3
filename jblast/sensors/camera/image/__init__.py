"""Light on its way into pixels: black bodies, compositing, grey."""
