"""Text from elsewhere, as a terminal may be given it."""


def plain_text(text: str) -> str:
    """Return text with a question mark for each character that would command a terminal."""
    return "".join(c if c.isprintable() or c in "\n\t" else "?" for c in text)
