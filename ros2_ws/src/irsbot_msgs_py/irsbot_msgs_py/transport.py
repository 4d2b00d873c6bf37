"""How our processes reach others: over UDP, never through memory that is shared with them.

In the shared memory of Fast DDS every reader has a queue that all its writers lock. A process that freezes, or is
stopped by a debugger, while it holds such a lock silences every other writer of that reader for as long as it stands:
a frozen joint driver, the supervisor that should tell of it. Small messages are as fast over UDP.
"""

from __future__ import annotations

from collections.abc import MutableMapping
from pathlib import Path

TRANSPORTS, PROFILES = "FASTDDS_BUILTIN_TRANSPORTS", "FASTRTPS_DEFAULT_PROFILES_FILE"
"""Environment variables of Fast DDS. Who sets one of them has chosen a transport, and keeps it."""

RANGE, PEERS = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS"

LOCALHOST = Path(__file__).with_name("localhost.xml")
"""What rmw_fastrtps does for the range LOCALHOST, but for the shared memory that it adds whatever else is asked for."""


def without_shared_memory(environment: MutableMapping[str, str], middleware: str) -> None:
    """Sets variables so that a process with this environment, which has not reached the middleware yet, uses UDP.

    middleware: identifier of the RMW implementation; none but Fast DDS is concerned.
    """
    chosen = environment.get(TRANSPORTS) or environment.get(PROFILES)
    if chosen or not middleware.startswith("rmw_fastrtps"):
        return
    environment[TRANSPORTS] = "UDPv4"
    if environment.get(RANGE, "").upper() == "LOCALHOST" and not environment.get(PEERS):
        environment[RANGE], environment[PROFILES] = "SYSTEM_DEFAULT", str(LOCALHOST)
