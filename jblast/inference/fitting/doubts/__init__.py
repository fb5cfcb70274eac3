"""Doubts of an answer: what was held fixed, and what was taken as flat."""
