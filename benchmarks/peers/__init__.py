"""Pretouch against its peers on the same problem: see docs/peers.md, run by `python -m benchmarks.peers`."""
