"""Pretouch against its peers on the same problem: see docs/explanation/peers.md; `python -m benchmarks.peers`."""
