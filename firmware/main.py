"""Started by MicroPython after each reset. As source, because MicroPython looks for no other; the rest is compiled."""

import service

service.run()
