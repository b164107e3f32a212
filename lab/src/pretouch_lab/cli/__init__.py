"""Commands that the lab adds to `pretouch`, by entry points in the group `pretouch.commands`."""
