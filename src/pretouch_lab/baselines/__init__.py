"""Detectors and cues that Pretouch is compared with: parts by entry points, as anybody else's."""
