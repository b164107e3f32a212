"""A unit reads what the host writes."""

from pretouch.units.keys import UnitKey
from pretouch.units.provision import Network, configuration
from tests.firmware.harness import Run

SHOW = """
import os, sys
os.chdir(sys.path[0])
import config
read = config.load()
for text in (read.ssid, read.password, read.host): print(text.encode())
print(read.unit, read.port, read.key == bytes(range(32)), read.zones, read.sensor)
"""


def test_a_unit_reads_what_the_host_writes_with_characters_beyond_16_bits(unit_python: Run) -> None:
    name, password = 'caf\u00e9 "x" \U0001f600', "\U0001f600" * 2
    network = Network(name, password, "10.0.0.1", 4950, sensor="vl53l7cx", zones=8)
    text = configuration(UnitKey("left", 7, bytes(range(32))), network)
    lines = unit_python({"config.json": text}, SHOW)
    assert lines == [str(name.encode()), str(password.encode()), "b'10.0.0.1'", "7 4950 True 8 vl53l7cx"]
