"""Times of day and dates as seconds from an epoch."""
