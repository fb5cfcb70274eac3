"""Colours of figures and maps; without Matplotlib, which takes a second to import."""

INK = "#222222"
MUTED = "#666666"
GRID = "#e4e4e4"
BLUE = "#0072B2"
VERMILLION = "#D55E00"
COLOURS = (BLUE, VERMILLION, "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Palette of Okabe and Ito (2008), safe for colour-blind readers."""
