"""How our processes reach others with Fast DDS: without shared memory, and soon after they have started.

In shared memory every reader has a queue that all its writers lock. A process that freezes, or is stopped by a
debugger, while it holds such a lock silences every other writer of that reader for as long as it stands: a frozen
joint driver, the supervisor that should tell of it. Small messages are as fast over UDP.

A process tells of itself when it starts, and then every 3 s. The answer of one that is there already often gets lost,
and then the new one hears nothing until those 3 s are over. Our profiles say 0.2 s.
"""

from __future__ import annotations

from collections.abc import MutableMapping
from pathlib import Path

TRANSPORTS, PROFILES = "FASTDDS_BUILTIN_TRANSPORTS", "FASTRTPS_DEFAULT_PROFILES_FILE"
"""Environment variables of Fast DDS. Who sets one of them has chosen, and keeps it."""

RANGE, PEERS = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS"

NETWORK, LOCALHOST = (str(Path(__file__).with_name(f"{name}.xml")) for name in ("network", "localhost"))


def choose_transport(environment: MutableMapping[str, str], middleware: str) -> None:
    """Sets what a process with this environment, which has not reached the middleware yet, is to use.

    middleware: identifier of the RMW implementation; none but Fast DDS is concerned. In the range LOCALHOST
    rmw_fastrtps adds shared memory whatever the profile says: unless peers are named, the profile replaces the range.
    """
    chosen = environment.get(TRANSPORTS) or environment.get(PROFILES, NETWORK) not in (NETWORK, LOCALHOST)
    if chosen or not middleware.startswith("rmw_fastrtps"):
        return
    if environment.get(RANGE, "").upper() == "LOCALHOST" and not environment.get(PEERS):
        environment[RANGE], environment[PROFILES] = "SYSTEM_DEFAULT", LOCALHOST
    elif environment.get(PROFILES) != LOCALHOST:
        environment[PROFILES] = NETWORK
