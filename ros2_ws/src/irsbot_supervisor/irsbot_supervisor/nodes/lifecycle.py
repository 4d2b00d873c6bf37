"""Answers life-cycle requests that the state does not allow; rclpy does not."""

from __future__ import annotations

from lifecycle_msgs.srv import ChangeState
from rclpy.lifecycle import LifecycleNode


def answer_every_request(node: LifecycleNode) -> None:
    """Make `~/change_state` answer "no" where rclpy raises and leaves the caller waiting for ever. Does nothing in an
    rclpy that stores its service elsewhere."""
    service = getattr(node, "_service_change_state", None)
    if service is None:
        return
    change = service.callback

    def answered(request: ChangeState.Request, response: ChangeState.Response) -> ChangeState.Response:
        try:
            return change(request, response)
        except Exception as error:  # RCLError, which rclpy does not export
            node.get_logger().warning(f"transition {request.transition.id} refused: {error}")
            response.success = False
            return response

    service.callback = answered


def forget_state_machine(node: LifecycleNode) -> None:
    """Destroy the state machine: it holds a reference to the node, and rclpy does not release it, so the node would
    stay in the graph. Does nothing in an rclpy that stores it elsewhere."""
    machine = getattr(node, "_state_machine", None)
    if machine is not None:
        machine.destroy_when_not_in_use()
