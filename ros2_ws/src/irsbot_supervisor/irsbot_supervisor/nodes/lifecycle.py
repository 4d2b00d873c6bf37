"""What a node with a life cycle lacks in rclpy: an answer to a request that its state does not allow."""

from __future__ import annotations

from lifecycle_msgs.srv import ChangeState
from rclpy.lifecycle import LifecycleNode


def answer_every_request(node: LifecycleNode) -> None:
    """`~/change_state` says no where rclpy raises, which leaves the caller waiting for ever."""
    service = node._service_change_state
    change = service.callback

    def answered(request: ChangeState.Request, response: ChangeState.Response) -> ChangeState.Response:
        try:
            return change(request, response)
        except Exception as error:  # RCLError, which rclpy does not export
            node.get_logger().warning(f"transition {request.transition.id} refused: {error}")
            response.success = False
            return response

    service.callback = answered
