"""The localisation benchmark: where contacts are said to be, held against where they are."""
