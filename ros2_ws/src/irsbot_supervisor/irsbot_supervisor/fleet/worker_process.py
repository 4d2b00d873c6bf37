"""Loaded first by every worker process that a command starts: Ctrl-C is for the command, which ends its workers."""

import signal

signal.signal(signal.SIGINT, signal.SIG_IGN)
