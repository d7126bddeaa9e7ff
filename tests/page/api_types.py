"""Writes the API's types for the check of the page: ``python -m tests.page.api_types FILE``.

The file declares a TypeScript interface for each schema of the OpenAPI document, in the namespace
`Api`. `make check` writes it anew each time, so it cannot be out of date. No property is optional,
because an answer carries all of them.
"""

import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from tests.support.api_document import api_document

Schema = Mapping[str, Any]

_PLAIN: Final = {
    "string": "string",
    "integer": "number",
    "number": "number",
    "boolean": "boolean",
    "null": "null",
}


def members(schemas: Mapping[str, Schema]) -> Iterator[str]:
    for name, schema in sorted(schemas.items()):
        if "properties" not in schema:
            yield f"  type {name} = {typed(schema)};"
            continue
        yield f"  interface {name} {{"
        for key, value in schema["properties"].items():
            yield f"    {key}: {typed(value)};"
        yield "  }"


def typed(schema: Schema) -> str:
    """The TypeScript type of what a JSON schema describes; `unknown` where it says nothing."""
    if "$ref" in schema:
        return str(schema["$ref"]).rsplit("/", 1)[-1]
    if "const" in schema:
        return json.dumps(schema["const"])
    if "enum" in schema:
        return " | ".join(map(json.dumps, schema["enum"]))
    for choice in ("anyOf", "oneOf"):
        if choice in schema:
            # The page neither sends nor gets fields in their forms as text.
            kinds = [one for one in schema[choice] if "as text" not in one.get("description", "")]
            return " | ".join(dict.fromkeys(map(typed, kinds)))
    match schema.get("type"):
        case "array" if "prefixItems" in schema:
            return f"[{', '.join(map(typed, schema['prefixItems']))}]"
        case "array":
            return f"Array<{typed(schema.get('items', {}))}>"
        case "object" if "properties" in schema:
            named = schema["properties"].items()
            return f"{{ {' '.join(f'{key}: {typed(value)};' for key, value in named)} }}"
        case "object":
            every = schema.get("additionalProperties", True)
            return f"Record<string, {'unknown' if every is True else typed(every)}>"
        case str(plain):
            return _PLAIN[plain]
    return "unknown"


if __name__ == "__main__":
    # The namespace `Api`: an interface or an alias for each schema.
    schemas = members(api_document()["components"]["schemas"])
    Path(sys.argv[1]).write_text("\n".join(("declare namespace Api {", *schemas, "}", "")), "utf-8")
