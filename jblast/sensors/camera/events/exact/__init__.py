"""Events of the law's own fireball, solved for, not sampled."""
