"""Two private attributes of rclpy are used: they are there, and without them nothing fails."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

import rclpy
from rclpy.context import Context
from rclpy.lifecycle import LifecycleNode

from irsbot_supervisor.nodes.lifecycle import answer_every_request, forget_state_machine
from irsbot_supervisor.processes.suite import free_domain

pytestmark = pytest.mark.ros


def test_the_rclpy_that_is_installed_has_them():
    context = Context()
    rclpy.init(context=context, domain_id=free_domain())
    node = LifecycleNode("guarded", context=context)
    assert callable(node._service_change_state.callback)
    assert callable(node._state_machine.destroy_when_not_in_use)
    forget_state_machine(node)
    node.destroy_node()
    rclpy.shutdown(context=context)


def test_an_rclpy_that_has_them_elsewhere_is_left_as_it_is():
    node: Any = SimpleNamespace()
    answer_every_request(node)
    forget_state_machine(node)
    assert vars(node) == {}
