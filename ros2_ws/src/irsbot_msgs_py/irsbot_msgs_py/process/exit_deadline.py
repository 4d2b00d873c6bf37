"""Ends this process at a set time; no thread, lock or interpreter can prevent it. Linux with glibc.

Fast DDS 2.14 waits for ever, while Python's global lock is held, if a participant is destroyed in the moment in which
another one appears or leaves. This happens when several nodes are ended together. Python code cannot run then.
"""

from __future__ import annotations

import ctypes
import time

_SIGEV_THREAD = 2


class _Event(ctypes.Structure):
    """struct sigevent for SIGEV_THREAD, sigevent(3type)."""

    _fields_ = (
        ("value", ctypes.c_void_p),
        ("signal", ctypes.c_int),
        ("notify", ctypes.c_int),
        ("function", ctypes.c_void_p),
        ("attributes", ctypes.c_void_p),
        ("padding", ctypes.c_char * 32),
    )


class _Setting(ctypes.Structure):
    """struct itimerspec, timer_settime(2)."""

    _fields_ = tuple((name, ctypes.c_long) for name in ("interval_s", "interval_ns", "first_s", "first_ns"))


def exit_within(seconds: int, code: int) -> None:
    """If the process has not ended after this number of whole seconds, it exits with this code, without cleaning up."""
    libc = ctypes.CDLL(None, use_errno=True)
    at_last = ctypes.cast(libc._exit, ctypes.c_void_p)
    event, timer = _Event(value=code, notify=_SIGEV_THREAD, function=at_last), ctypes.c_void_p()
    setting = _Setting(first_s=seconds)
    if libc.timer_create(time.CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)) or libc.timer_settime(
        timer, 0, ctypes.byref(setting), None
    ):
        raise OSError(ctypes.get_errno(), "no timer for the end of the process")
