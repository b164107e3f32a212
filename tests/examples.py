"""How many examples a property is tried with: by default a quarter of what the profile `nightly` tries."""

from hypothesis import settings


def examples(nightly: int, least: int = 1) -> settings:
    """Return the settings of a property tried with so many examples at night, and with no fewer than `least` by day."""
    return settings(max_examples=max(least, nightly * settings.default.max_examples // 100))
