"""The skin's sensor units on the network, as their receiver sees them, and simulated ones."""

HOST = "127.0.0.1"
"""Where sensor units send to, unless somebody says otherwise: only what runs on this machine is heard there, real units
need `EVERYWHERE`."""
PORT = 29470
"""UDP port of the receiver: of those that IANA has assigned to nobody, and below those that a system gives to whoever
asks for any (of Linux: from 32768), which may be taken when the receiver starts."""
EVERYWHERE = "0.0.0.0"  # noqa: S104
"""All addresses of this machine."""
