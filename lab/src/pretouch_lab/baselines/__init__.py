"""What Pretouch is compared with: parts by entry points, and the profiles of each benchmark."""
