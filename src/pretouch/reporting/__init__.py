"""Report of a recording: one page to keep."""
