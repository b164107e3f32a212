"""The documentation site: pages by hand, pages that the code writes, and links that hold in both."""
