"""What Pretouch is compared with, as parts of a profile by entry points, as anybody else's."""
