"""Certified lower bounds of margins over sets of joint positions."""
