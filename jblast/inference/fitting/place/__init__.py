"""Where the charge stood: how far off the answer may be, and how far its shock went."""
