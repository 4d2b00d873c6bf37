"""Plain records of the messages between processes; only `convert` and `process.run` need ROS."""
