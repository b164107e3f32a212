"""Franka arms over the vendor's own client libraries."""
