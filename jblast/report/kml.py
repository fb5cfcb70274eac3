"""KML documents: root, text elements and coordinates."""

from xml.etree import ElementTree as ET

import numpy as np
from jaxtyping import Float

NAMESPACE = "http://www.opengis.net/kml/2.2"


def new_document(title: str) -> tuple[ET.Element, ET.Element]:
    """Return the root of a new file and its document with a title."""
    root = ET.Element("kml", xmlns=NAMESPACE)
    document = ET.SubElement(root, "Document")
    add_text(document, "name", title)
    return root, document


def document_text(root: ET.Element) -> str:
    """Return the text of a file, indented."""
    ET.indent(root)
    text = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def add_text(parent: ET.Element, name: str, value: object) -> None:
    """Add an element with a text; characters that XML forbids are removed."""
    # XML 1.0 forbids control characters even as references
    text = "".join(c for c in str(value) if c.isprintable())
    ET.SubElement(parent, name).text = text


def coordinates(places: Float[np.ndarray, "place axis"]) -> str:
    """Return positions as KML coordinates.

    Args:
        places: Longitude and latitude [degree], with nine decimals (0.1 mm), and the
            height [m] if there are three columns.
    """
    return " ".join(
        ",".join([f"{lon:.9f}", f"{lat:.9f}", *(f"{up:.3f}" for up in height)])
        for lon, lat, *height in places
    )
