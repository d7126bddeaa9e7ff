"""The JSON schema of a merge patch for objects of another schema."""

from typing import Any, Final

_Schema = dict[str, Any]

#: Keywords that do not apply to a patch. It requires nothing, and the names of the whole's parts
#: belong to other schemas.
_OF_THE_WHOLE: Final = frozenset(
    {"required", "default", "discriminator", "examples", "title", "$defs"}
)
_EITHER: Final = ("anyOf", "oneOf")
_NULL: Final[_Schema] = {"type": "null"}


def merge_patch(schema: _Schema) -> _Schema:
    """The schema of a JSON merge patch (RFC 7396) for the values of this schema.

    A patch of an object may omit members, and null removes one; any other value is replaced whole.
    The result has the definitions under ``$defs`` inlined.
    """
    return _patch(schema, schema.get("$defs", {}))


def _patch(schema: _Schema, defs: dict[str, _Schema]) -> _Schema:
    whole = _resolved(schema, defs)
    patch = {name: value for name, value in whole.items() if name not in _OF_THE_WHOLE}
    if "properties" in whole:
        patch["properties"] = {
            name: _or_null(member, defs) for name, member in whole["properties"].items()
        }
    if isinstance(whole.get("additionalProperties"), dict):
        patch["additionalProperties"] = _or_null(whole["additionalProperties"], defs)
    for either in _EITHER:
        if either in patch:
            # A patch may match several alternatives of a whole that matches exactly one.
            patch["anyOf"] = [_patch(one, defs) for one in patch.pop(either)]
    for items in ("items", "prefixItems"):
        if items in patch:
            patch[items] = _inlined(patch[items], defs)
    return patch


def _or_null(schema: _Schema, defs: dict[str, _Schema]) -> _Schema:
    patch = _patch(schema, defs)
    said = {"description": patch.pop("description")} if "description" in patch else {}
    either = patch.pop("anyOf", None) or [patch]
    return {**said, "anyOf": either if _NULL in either else [*either, _NULL]}


def _resolved(schema: _Schema, defs: dict[str, _Schema]) -> _Schema:
    """The schema with its reference resolved; keywords beside the reference take precedence."""
    reference = schema.get("$ref")
    if reference is None:
        return schema
    beside = {name: value for name, value in schema.items() if name != "$ref"}
    return {**_resolved(defs[reference.rpartition("/")[2]], defs), **beside}


def _inlined(schema: Any, defs: dict[str, _Schema]) -> Any:
    """A schema, or a part of one, with all references resolved and nothing optional."""
    if isinstance(schema, list):
        return [_inlined(one, defs) for one in schema]
    if not isinstance(schema, dict):
        return schema
    return {
        name: _inlined(one, defs)
        for name, one in _resolved(schema, defs).items()
        if name not in {"discriminator", "title"}
    }
