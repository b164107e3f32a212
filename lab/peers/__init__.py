"""Comparison of Pretouch with its peers on one problem: docs/explanation/peers.md; `python -m lab.peers` in a clone."""
