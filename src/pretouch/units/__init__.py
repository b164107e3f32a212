"""Sensor units on the network: their receiver, their health, and simulated units."""

HOST = "127.0.0.1"
"""Default address that sensor units send to: only programs on this machine can reach it, real units
need `EVERYWHERE`."""
PORT = 29470
"""UDP port of the receiver: of those that IANA has assigned to nobody, and below those that a system gives to whoever
asks for any (of Linux: from 32768), which may be taken when the receiver starts."""
EVERYWHERE = "0.0.0.0"  # noqa: S104
"""All addresses of this machine."""
