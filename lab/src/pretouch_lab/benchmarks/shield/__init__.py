"""The shield benchmark: what holds whoever commands, and other filters in the same place."""
