"""The part of this package that needs ROS."""
