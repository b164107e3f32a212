"""The command `pretouch run`."""
