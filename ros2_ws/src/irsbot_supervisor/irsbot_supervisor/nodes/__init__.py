"""Shells around the core: convert, step, convert, publish. The part of this package that needs rclpy."""
