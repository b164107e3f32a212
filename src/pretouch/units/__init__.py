"""What is at the other end of a wire: sensor units, their keys, and how well they are."""
