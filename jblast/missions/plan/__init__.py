"""The file of a plan: what a ground station wrote, read and written back."""
