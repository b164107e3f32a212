"""Messages that once ended a program or kept it busy: each begins the fuzz of whoever reads it."""

ANSWERS = [
    b"[" * 100_000,
    b'[{"key": "abc", "metrics": {}, "seconds": 1}]',
    b'[{"key": ["abc"], "seconds": NaN}]',
    b"\x80\x04\x95cos\nsystem\n",
]
