"""The answer on a map: a figure in metres, GeoJSON and KML in degrees."""
