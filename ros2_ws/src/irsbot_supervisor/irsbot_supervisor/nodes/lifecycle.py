"""What a node with a life cycle lacks in rclpy: an answer to a request that its state does not allow."""

from __future__ import annotations

from lifecycle_msgs.srv import ChangeState
from rclpy.lifecycle import LifecycleNode


def answer_every_request(node: LifecycleNode) -> None:
    """`~/change_state` says no where rclpy raises, which leaves the caller waiting for ever. In an rclpy that keeps its
    service elsewhere it stays like that."""
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
    """It holds on to the node, and rclpy forgets it when a node is destroyed: then the node stays in the graph. In an
    rclpy that keeps it elsewhere nothing is done."""
    machine = getattr(node, "_state_machine", None)
    if machine is not None:
        machine.destroy_when_not_in_use()
