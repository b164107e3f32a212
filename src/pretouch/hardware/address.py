"""Where sensor units send to, unless somebody says otherwise."""

HOST = "127.0.0.1"
"""Only what runs on this machine is heard there: real units need 0.0.0.0, all addresses of this machine."""
PORT = 29470
"""UDP port of the receiver: of those that IANA has assigned to nobody, and below those that a system gives to whoever
asks for any (of Linux: from 32768), which may be taken when the receiver starts."""
EVERYWHERE = "0.0.0.0"  # noqa: S104
"""All addresses of this machine."""
