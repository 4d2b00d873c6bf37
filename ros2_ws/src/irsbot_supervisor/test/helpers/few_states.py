"""A supervisor in a process of its own that may publish few states: any robot gives it more samples."""

from __future__ import annotations

STATES_HZ, STATES_AT_ONCE = 10.0, 30.0

if __name__ == "__main__":
    from irsbot_supervisor.nodes import supervisor

    supervisor.STATES_HZ, supervisor.STATES_AT_ONCE = STATES_HZ, STATES_AT_ONCE
    supervisor.main()
