"""Golden steps: every field of every `ControlStep`, held from one version of the code to the next.

`fields.py` names the fields, `streams.py` and `closed.py` make the inputs, `kept.py` keeps and compares what comes of
them. Names of inputs and fields stay when the code's own names change.
"""
