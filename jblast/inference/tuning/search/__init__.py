"""Where the numbers looked for are, and how a search for them goes."""
