"""`plateau redis-acl`: the users of a Redis for the farm's processes, each with what it needs."""

import os
import re
import secrets
import sys
from pathlib import Path

from plateau.errors import CommandFailed
from plateau.farm.redis.acl import acl_file, rules
from plateau.files.out_folder import make

_VERSION = re.compile(r"(\d+)\.(\d+)(\.\d+)*")


def redis_acl(passwords: Path | None, redis: str) -> None:
    """Print an ACL file; passwords that are missing in their folder are made."""
    match = _VERSION.fullmatch(redis)
    version = (int(match[1]), int(match[2])) if match else (0, 0)
    if version < (6, 2):
        raise CommandFailed(f"{redis!r} is not a version of Redis from 6.2 on")
    users = rules(version)
    known = {} if passwords is None else {user: _password(passwords, user) for user in users}
    print(acl_file(known, version), end="")


def _password(folder: Path, user: str) -> str:
    """The user's password; where it has none yet, one is made, for its owner's eyes alone."""
    file = folder / f"{user}.password"
    if not file.exists():
        make(folder, "--passwords", mode=0o700)
        descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "w") as made:
            made.write(f"{secrets.token_hex(32)}\n")
        print(f"plateau: made {file}", file=sys.stderr)
    password = file.read_text().strip()
    if not password:
        raise CommandFailed(f"{file} is empty")
    return password
