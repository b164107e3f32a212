"""UDP as MicroPython's `socket` shows it, to the receiver in `state`; error 118 without the network."""

import network

AF_INET, SOCK_DGRAM = 2, 2


class state:
    receiver = None
    sent_to = ()


def getaddrinfo(host, port):
    return [(AF_INET, SOCK_DGRAM, 0, "", (host, port))]


class socket:
    errno = 0
    """With which it fails."""
    closed = False

    def __init__(self, family=AF_INET, kind=SOCK_DGRAM):
        assert (family, kind) == (AF_INET, SOCK_DGRAM)

    def bind(self, address):
        self.bound = address

    def setblocking(self, blocking):
        assert not blocking

    def sendto(self, datagram, address):
        if self.errno or not network.state.joined:
            raise OSError(self.errno or 118)
        if address not in state.sent_to:
            state.sent_to += (address,)
        state.receiver.send(datagram)

    def readinto(self, buffer):
        if self.errno:
            raise OSError(self.errno)
        return state.receiver.receive(buffer) or None

    def close(self):
        self.closed = True
