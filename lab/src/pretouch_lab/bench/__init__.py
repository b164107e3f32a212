"""Benchmarks of detectors and controllers on the same arms, contacts and bystanders."""
