"""JSON Schema of the spacecraft file, from the sections that read it."""

from __future__ import annotations

from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from nutdamp.files.models import SpacecraftFile
from nutdamp.files.sections import REQUIRED, Rule, Section, section_of


def json_schema() -> dict[str, Any]:
    """JSON Schema (2020-12) of the spacecraft file, for editors."""
    parts: dict[str, Any] = {}
    whole = {**section_schema(SpacecraftFile, parts), "title": "nutdamp spacecraft file"}
    schema = {"$defs": dict(sorted(parts.items())), **whole}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **_in_order(schema)}


def section_schema(section: type[Section], parts: dict[str, Any]) -> dict[str, Any]:
    """JSON Schema of a section; those that it refers to are added to ``parts``."""
    properties = {}
    for name, key in section.fields().items():
        properties[name] = {**_schema(key.type, parts), "description": key.description, "examples": key.examples}
        if key.default is not None and key.default is not REQUIRED:
            properties[name]["default"] = key.default
    required = [name for name, key in section.fields().items() if key.default is REQUIRED]
    about = " ".join((section.__doc__ or "").split())
    found: dict[str, Any] = {"type": "object", "title": section.__name__, "description": about}
    found |= {"properties": properties, "additionalProperties": False, **section.schema_extra}
    return {**found, "required": required} if required else found


def _schema(annotation: Any, parts: dict[str, Any]) -> dict[str, Any]:
    """JSON Schema of a type."""
    origin, of = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _ruled_schema(of[0], of[1:], parts)
    if origin in (Union, UnionType):
        given = [_schema(one, parts) for one in of if one is not NoneType]
        return given[0] if len(given) == 1 else {"oneOf": given}
    if origin is Literal:
        return {"type": "string", **({"enum": list(of)} if len(of) > 1 else {"const": of[0]})}
    section = section_of(annotation)
    if section is not None and section is annotation:
        if section.__name__ not in parts:
            parts[section.__name__] = section_schema(section, parts)
        return {"$ref": f"#/$defs/{section.__name__}"}
    if origin is list:
        return {"type": "array", "items": _schema(of[0], parts)}
    if origin is tuple:
        entries = [_schema(one, parts) for one in of]
        return {"type": "array", "prefixItems": entries, "minItems": len(of), "maxItems": len(of)}
    if origin is dict:
        return {"type": "object", "additionalProperties": _schema(of[1], parts)}
    return {} if annotation is Any else {"type": {str: "string", int: "integer", bool: "boolean"}[annotation]}


def _ruled_schema(annotation: Any, rules: tuple[Rule, ...], parts: dict[str, Any]) -> dict[str, Any]:
    if not rules:
        return _schema(annotation, parts)
    return rules[-1].schema(lambda: _ruled_schema(annotation, rules[:-1], parts))


def _in_order(schema: Any, within: str = "") -> Any:
    """Keywords in the order of the alphabet, properties in that of the section."""
    if isinstance(schema, dict):
        names = schema if within in ("properties", "default") else sorted(schema)
        return {name: _in_order(schema[name], name if within != "properties" else "") for name in names}
    return [_in_order(one, within) for one in schema] if isinstance(schema, list) else schema
