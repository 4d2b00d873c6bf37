"""kinematics_node that finds every request too long. Run as a module."""

from __future__ import annotations

import sys

import irsbot_kinematics.nodes.kinematics as node

if __name__ == "__main__":
    node.BUSY_S = 0.0
    sys.exit(node.main())
