"""Plain records of the messages between processes; only `convert` needs ROS."""
