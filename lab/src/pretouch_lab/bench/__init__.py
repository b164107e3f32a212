"""Detectors and controllers held against each other on the same arms, contacts and bystanders."""
