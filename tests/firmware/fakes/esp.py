"""What an ESP8266 has besides."""

SLEEP_NONE, SLEEP_MODEM = 0, 2


class State:
    sleep = SLEEP_MODEM


def sleep_type(kind):
    State.sleep = kind
