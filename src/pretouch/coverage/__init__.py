"""How much of an arm's surroundings its units see in time: shares by link, blind spots, and places for more units."""
