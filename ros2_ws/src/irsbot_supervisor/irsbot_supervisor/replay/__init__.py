"""Recorded runs judged again, and compared with what was recorded or expected."""
