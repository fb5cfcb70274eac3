"""A record made ready: its front, its noise, its bins, where a fit begins."""
