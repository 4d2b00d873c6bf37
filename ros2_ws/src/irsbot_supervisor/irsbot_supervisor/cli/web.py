"""Options of the live page, which `up` and `monitor` share."""

from __future__ import annotations

import socket
from importlib.util import find_spec
from typing import Annotated

import typer

from irsbot_kinematics import BadInput

WEB_HOST, WEB_PORT = "localhost", 8765
WebHost = Annotated[str, typer.Option(help="address of this machine at which the page is served")]
WebPort = Annotated[int, typer.Option(help="port of the page", min=1, max=65535)]


def check_page(host: str, port: int) -> None:
    """Refuse a page that cannot be served, before anything starts. Raises BadInput."""
    for module in ("jinja2", "websockets"):
        if find_spec(module) is None:
            raise BadInput(f"a page needs {module}: 'pip install {module}'")
    try:
        for family, kind, protocol, _name, address in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM):
            with socket.socket(family, kind, protocol) as probe:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as the server does
                probe.bind(address)
    except OSError as error:
        raise BadInput(f"no page at {host}:{port}: {error.strerror}; --web-port gives another port") from None
