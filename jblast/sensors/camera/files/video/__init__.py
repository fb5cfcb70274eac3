"""Videos: read as linear light with times, and written; by FFmpeg, through PyAV."""
