"""A server each, whose links can be pushed: a line `LINK FX FY FZ` is answered by the joint torques of that push."""
