"""`python -m irsbot_supervisor` is the command line `irsbot`."""

from irsbot_supervisor.executables import irsbot

irsbot()
