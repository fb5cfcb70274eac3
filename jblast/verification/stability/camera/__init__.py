"""Where cameras and event pixels fail."""
