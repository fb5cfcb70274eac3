"""The calculator's answer: terminal, files, figure."""
