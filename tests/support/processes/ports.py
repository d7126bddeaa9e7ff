"""Ports at which nobody listens."""

import socket


def free_ports(count: int = 1) -> list[int]:
    """So many free ports; all are held until the last is known."""
    held = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    try:
        return [one.getsockname()[1] for one in held]
    finally:
        for one in held:
            one.close()
