"""Contact detectors held against each other: free motion, contacts, and boards that stay where they are."""
