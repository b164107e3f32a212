"""Pretouch and its peers on the same problem: see docs/explanation/peers.md; `python -m lab.peers`, of a clone."""
