"""Several words in one option."""


def words(text: str) -> tuple[str, ...]:
    """Return the words between commas."""
    return tuple(part.strip() for part in text.split(",") if part.strip())
