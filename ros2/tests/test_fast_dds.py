"""Against Fast DDS and Fast CDR, which are under rmw_fastrtps: another DDS, and another encoder, in both directions."""

import fcntl
import hashlib
import math
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from time import sleep
from typing import Any

import numpy as np
import pytest
from tests.needs import skip_for

from pretouch_ros2.messages import JOINT_STATE, RANGE, TRAJECTORY, TWIST, WRENCH
from pretouch_ros2.node import Ros2Node
from pretouch_ros2.params import NodeParams

HERE = Path(__file__).parent
LAYOUTS = {
    JOINT_STATE: "ius[s][d][d][d]",
    WRENCH: "iusdddddd",
    RANGE: "iusbfffff",
    TRAJECTORY: "ius[s][[d][d][d][d]iu]",
    TWIST: "iusdddddd",
}
LINES = {
    JOINT_STATE: [
        "12 34 :panda_link0 3 :a :bcd :panda_joint3 3 0.1 nan -inf 0 1 1e-300",
        f"-1 999999999 : 0 2 1.5 {math.pi!r} 0 0",
        f"2 0 :{'x' * 3001} 1 : 1 0 1 2 1 3",
    ],
    WRENCH: ["1 2 :fr3_link0 1 -2 3.25 nan inf -0.5", "0 0 : 0 0 0 0 0 0"],
    RANGE: ["7 8 :forearm_1 1 0.5 0.0625 4 inf 0.25", "0 1 :u 0 0 0 0 -inf nan"],
    TRAJECTORY: ["0 0 : 2 :j1 :j2 2 2 0.1 0.2 2 1 -1 0 0 0 50000000 2 0.3 0.4 2 0 0 0 0 1 0", "0 0 :base 1 :joint 0"],
    TWIST: ["1 2 :panda_link0 0.1 0 -0.25 0 nan 1"],
}


@pytest.fixture(scope="session")
def fast_peer(tmp_path_factory):
    """The peer, compiled once for all processes of a test run."""
    compiler = shutil.which("g++")
    if compiler is None or not Path("/usr/include/fastdds/dds/domain/DomainParticipant.hpp").exists():
        skip_for("apt-get install g++ libfastrtps-dev libfastcdr-dev")
    source = HERE / "fast_peer.cpp"
    own = tmp_path_factory.getbasetemp()
    folder = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "fast_dds"
    folder.mkdir(exist_ok=True)
    built = folder / f"peer-{hashlib.sha256(source.read_bytes()).hexdigest()[:16]}"
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not built.exists():
            command = [compiler, "-std=c++17", "-O0", "-o", f"{built}.part", str(source), "-lfastrtps", "-lfastcdr"]
            subprocess.run(command, check=True)
            Path(f"{built}.part").rename(built)
    return built


def peer(fast_peer: Path, domain: int, kind: str, *how: str, layout: str = "") -> subprocess.Popen[str]:
    given = [str(domain), "rt/topic", kind.replace("/msg/", "::msg::dds_::") + "_", layout or LAYOUTS[kind], *how]
    return subprocess.Popen([fast_peer, *given], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def words_of(message: Any) -> Iterator[str]:
    """Write a message as Fast DDS' peer does, through the fields that rosbags gave it."""
    if isinstance(message, str):
        yield f":{message}"
    elif isinstance(message, list | np.ndarray):
        yield str(len(message))
        for element in message:
            yield from words_of(element)
    elif isinstance(message, int | float | np.number):
        yield repr(float(message))
    else:
        for name in message.__dataclass_fields__:
            if name.islower() and name[0] != "_":  # no constant, and not the type
                yield from words_of(getattr(message, name))


def same(one: str, another: str) -> bool:
    """Whether two lines say the same, numbers by their value."""
    pairs = list(zip(one.split(" "), another.split(" "), strict=True))
    return all(a == b if a[:1] == ":" else repr(float(a)) == repr(float(b)) for a, b in pairs)


OTHERS = [pytest.param(kind, "reliable", marks=pytest.mark.slow) for kind in LINES if kind != TRAJECTORY]


@pytest.mark.parametrize(("kind", "how"), [(TRAJECTORY, "reliable"), (JOINT_STATE, "best"), *OTHERS])
def test_what_fast_dds_publishes_is_read_and_it_reads_what_is_published(fast_peer, node, other, domain, kind, how):
    messages: list[Any] = []
    subscription = other.subscribe("/topic", kind, lambda message, *_: messages.append(message))
    with peer(fast_peer, domain, kind, "pub", how) as process:
        assert other.wait_for(lambda: subscription.publishers == 1, 20)
        process.communicate("".join(f"{line}\n" for line in LINES[kind]), timeout=30)
    assert process.returncode == 0
    assert other.wait_for(lambda: len(messages) == len(LINES[kind]), 5)
    got = [" ".join(words_of(message)) for message in messages]
    assert all(same(a, b) for a, b in zip(got, LINES[kind], strict=True)), got
    publisher = node.publisher("/topic", kind)
    with peer(fast_peer, domain, kind, "sub", str(len(messages))) as process:
        assert node.wait_for(lambda: publisher.subscribers == 2, 20)
        sleep(0.2)  # until the other side has matched too
        for message in list(messages):
            publisher.publish(message)
        printed, _ = process.communicate(timeout=30)
    assert process.returncode == 0
    lines = [line.strip() for line in printed.splitlines()]
    assert all(same(a, b) for a, b in zip(lines, LINES[kind], strict=True)), lines


@pytest.mark.parametrize("distribution", ["humble", "jazzy"])
def test_a_range_of_the_other_layout_is_not_taken_for_ours(fast_peer, domain, distribution):
    theirs = {"humble": "iusbfffff", "jazzy": "iusbffff"}[distribution]
    line = "7 8 :forearm_1 1 0.5 0.0625 4 1.5" + (" 0.25" if distribution == "humble" else "")
    got: list[Any] = []
    with Ros2Node(NodeParams(distribution, domain)) as node:
        subscription = node.subscribe("/topic", RANGE, lambda message, *_: got.append(message))
        with peer(fast_peer, domain, RANGE, "pub", "reliable", layout=theirs) as process:
            print(line, file=process.stdin, flush=True)
            assert node.wait_for(lambda: bool(subscription.unreadable), 20)
            said = subscription.unreadable
            process.communicate(timeout=30)
        assert f"sensor_msgs/msg/Range of {distribution}: choose the sender's distribution" in said
    assert not got
