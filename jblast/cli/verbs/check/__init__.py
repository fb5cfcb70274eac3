"""A log before it is fitted; which method will do, and where each breaks."""
