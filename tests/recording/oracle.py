"""rosbags, which knows nothing of our codec: an independent reader and writer of our messages."""

from functools import cache

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from pretouch.recording.messages import OWN, PACKAGE, own_definition


@cache
def typestore() -> Typestore:
    """Return the types of ROS 2 Jazzy, and ours."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for name in OWN:
        store.register(get_types_from_msg(own_definition(name), f"{PACKAGE}/msg/{name}"))
    return store
