"""Where the API listens, and how it is asked to."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Door:
    """The options of `plateau api` that `plateau up` has too."""

    host: str = "127.0.0.1"
    port: int = 0  #: 0 takes a free one
    open_to_all: bool = False  #: want no keys, on a loopback address, though there are some
    certificate: Path | None = None  #: for https, with its private key
    private_key: Path | None = None

    def options(self) -> tuple[str, ...]:
        """All but the port, as they are written on a command line."""
        options = ["--host", self.host]
        if self.open_to_all:
            options.append("--open")
        if self.certificate is not None:
            options += ["--tls-certificate", str(self.certificate)]
        if self.private_key is not None:
            options += ["--tls-key", str(self.private_key)]
        return tuple(options)
