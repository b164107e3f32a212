"""Published ways to do what parts of the product do, as parts of a profile: for comparison only."""
