"""What `jblast study` does beside running a study: it puts stores together."""
