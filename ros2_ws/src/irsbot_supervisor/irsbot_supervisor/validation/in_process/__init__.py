"""Campaigns that run the core in this process."""
