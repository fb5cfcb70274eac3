"""Names and comments as CSV files hold them."""


def plain_text(text: str) -> str:
    """Return a text that is one line.

    Raises:
        ValueError: It is not, or begins or ends with a blank.
    """
    unreadable = any(c != "\t" and (ord(c) < 32 or ord(c) == 127) for c in text)
    if unreadable or text != text.strip():
        raise ValueError(
            "a name or comment must be one line without control characters or outer "
            f"spaces, got {text!r}"
        )
    return text


def quoted(name: str) -> str:
    """Return a name as CSV; a leading # would otherwise make its row a comment.

    Raises:
        ValueError: It is not one line, or begins or ends with a blank.
    """
    name = plain_text(name)
    if any(c in name for c in ',"') or name.startswith("#"):
        return '"' + name.replace('"', '""') + '"'
    return name
