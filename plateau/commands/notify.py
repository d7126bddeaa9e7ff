"""`plateau notify`: a test message to a target of notices."""

import json

from plateau.errors import CommandFailed
from plateau.processes.read_settings import read_settings
from plateau.service.monitor.notifier.notes import Note, NotNotified, send
from plateau.service.notices.targets import read_targets

_TEST = Note("Plateau: a test", "This target is notified when jobs end that name it.")


def notify(name: str, *, as_json: bool) -> None:
    """Send the test message, or fail with what apprise said."""
    url = read_targets(read_settings()).url(name)
    try:
        send(name, url, _TEST)
    except NotNotified as error:
        raise CommandFailed(f"{name} was not notified: {error.said}") from None
    print(json.dumps({"target": name, "notified": True}) if as_json else f"{name} was notified")
