"""What tests share."""

from typing import Any, Final

#: What tests' jobs are unless they say more: small and whole films end by it soon.
FRAMES: Final[dict[str, Any]] = {"rule": "visible", "allocation": "frame", "view": "paper"}
