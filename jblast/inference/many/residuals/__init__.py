"""Residuals of a batch of logs, row program by row program."""
