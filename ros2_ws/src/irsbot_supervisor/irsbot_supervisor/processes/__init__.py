"""Processes of the suite: start them, listen to them, operate them."""
