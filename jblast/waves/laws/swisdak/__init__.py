"""Swisdak (1994): simplified Kingery air blast, hemispherical."""
