"""Options of the live page and of the server for Foxglove, which `up` and `monitor` share."""

from __future__ import annotations

import socket
from importlib.util import find_spec
from typing import Annotated

import typer

from irsbot_kinematics import BadInput

WEB_HOST, WEB_PORT = "localhost", 8765
WebHost = Annotated[str, typer.Option(help="address of this machine at which the page is served")]
WebPort = Annotated[int, typer.Option(help="port of the page", min=1, max=65535)]

FOXGLOVE_PORT = 8766
"""Not the page's, so that both can be served."""

FoxgloveHost = Annotated[str, typer.Option(help="address of this machine at which Foxglove is served")]
FoxglovePort = Annotated[int, typer.Option(help="port for Foxglove", min=1, max=65535)]


def check_page(host: str, port: int) -> None:
    """Refuse a page that cannot be served, before anything starts. Raises BadInput."""
    _need("a page", jinja2="jinja2", orjson="orjson", websockets="websockets")
    _need_address("page", host, port, "--web-port")


def check_foxglove(host: str, port: int) -> None:
    """Refuse to serve Foxglove where it cannot be, before anything starts. Raises BadInput."""
    _need("--foxglove", foxglove="foxglove-sdk")
    _need_address("server for Foxglove", host, port, "--foxglove-port")


def _need(what: str, **modules: str) -> None:
    """modules: what is imported, and the name by which pip knows it."""
    for module, package in modules.items():
        if find_spec(module) is None:
            raise BadInput(f"{what} needs {package}: 'pip install {package}'")


def _need_address(what: str, host: str, port: int, option: str) -> None:
    try:
        for family, kind, protocol, _name, address in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM):
            with socket.socket(family, kind, protocol) as probe:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as the server does
                probe.bind(address)
    except UnicodeError:
        raise BadInput(f"no {what} at {host}:{port}: '{host}' is no name of a machine") from None
    except OSError as error:
        raise BadInput(f"no {what} at {host}:{port}: {error.strerror}; {option} gives another port") from None
