"""The paper's three experiments, its claims, and its figures."""
