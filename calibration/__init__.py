"""Questions asked of real or published data: one script each, and its table."""
