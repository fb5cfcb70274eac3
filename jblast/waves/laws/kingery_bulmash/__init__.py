"""Kingery and Bulmash (1984): TNT in free air and on the ground."""
