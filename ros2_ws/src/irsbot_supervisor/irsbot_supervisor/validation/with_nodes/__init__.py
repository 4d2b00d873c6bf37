"""Campaigns that run nodes as processes."""
