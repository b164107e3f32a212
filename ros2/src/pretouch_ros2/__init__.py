"""An arm and sensor units on ROS 2 topics: the arm `ros2` of `pretouch run`. No ROS has to be installed."""
