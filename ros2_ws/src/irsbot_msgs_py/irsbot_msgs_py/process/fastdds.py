"""Transport of our processes with Fast DDS: UDP instead of shared memory, and early discovery.

In shared memory every reader has a queue that all its writers lock. A process that freezes, or is stopped by a
debugger, while it holds such a lock blocks every other writer of that reader: for example a frozen joint driver would
silence the supervisor. Small messages are as fast over UDP.

By default, a process announces itself when it starts, and then every 3 s. The answer of a running process often gets
lost; then the new process receives nothing for 3 s. Our profiles announce every 0.2 s.
"""

from __future__ import annotations

from collections.abc import MutableMapping
from pathlib import Path

TRANSPORTS, PROFILES = "FASTDDS_BUILTIN_TRANSPORTS", "FASTRTPS_DEFAULT_PROFILES_FILE"
"""Environment variables of Fast DDS. If a user has set one of them, it is kept."""

RANGE, PEERS = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS"

ONLY_LOCALHOST = "ROS_LOCALHOST_ONLY"
"""With the value 1 the range is LOCALHOST, and rcl ignores RANGE and PEERS. Deprecated since ROS 2 Iron."""

NETWORK, LOCALHOST = (str(Path(__file__).with_name(f"{name}.xml")) for name in ("network", "localhost"))


def choose_transport(environment: MutableMapping[str, str], middleware: str) -> None:
    """Set the transport in the environment of a process that has not started the middleware yet.

    middleware: identifier of the RMW implementation; only Fast DDS is affected. In the range LOCALHOST rmw_fastrtps
    adds shared memory in spite of the profile: unless peers are named, the profile replaces the range.
    """
    chosen = environment.get(TRANSPORTS) or environment.get(PROFILES, NETWORK) not in (NETWORK, LOCALHOST)
    if chosen or not middleware.startswith("rmw_fastrtps"):
        return
    if environment.get(ONLY_LOCALHOST) == "1":
        del environment[ONLY_LOCALHOST]
        environment.pop(PEERS, None)
        environment[RANGE] = "LOCALHOST"
    if environment.get(RANGE, "").upper() == "LOCALHOST" and not environment.get(PEERS):
        environment[RANGE], environment[PROFILES] = "SYSTEM_DEFAULT", LOCALHOST
    elif environment.get(PROFILES) != LOCALHOST:
        environment[PROFILES] = NETWORK
