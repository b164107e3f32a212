"""From external force to contact, and from contact to the reaction."""
