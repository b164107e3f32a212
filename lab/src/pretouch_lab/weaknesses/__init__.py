"""The paper's weaknesses, each with its run and its number."""
