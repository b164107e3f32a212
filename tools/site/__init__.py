"""The documentation site: pages written by hand, generated pages, and links that work on both."""
