"""Plain records of what crosses a process; `convert` is the only module that needs ROS."""
