"""What a recording tells, as a page to keep."""
