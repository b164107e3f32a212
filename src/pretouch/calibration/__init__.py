"""Pose of each sensor unit on its link, estimated from its IMU while the arm moves."""
