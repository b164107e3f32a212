"""What Pretouch is compared with: detectors and cues as parts by entry points, and the profiles of each benchmark."""
