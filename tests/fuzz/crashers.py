"""Messages that once ended a program or kept it busy: each begins the fuzz of whoever reads it."""

import msgspec

PAGE = [
    msgspec.msgpack.encode(message)
    for message in (
        {"type": "GuiUpdateMessage", "uuid": "a", "updates": {"value": float("nan")}},
        {"type": "GuiUpdateMessage", "uuid": "a", "updates": {"removed": True}},
        {"type": "ShareUrlRequest"},
        {"type": ["a"]},
    )
] + [b"\x91" * 3000]
ANSWERS = [
    b"[" * 100_000,
    b'[{"key": "abc", "metrics": {}, "seconds": 1}]',
    b'[{"key": ["abc"], "seconds": NaN}]',
    b"\x80\x04\x95cos\nsystem\n",
]
