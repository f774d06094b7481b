"""JSON Schema of the spacecraft file, from the models that read it."""

from __future__ import annotations

from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from nutdamp.files.models import SpacecraftFile


class _Schema(GenerateJsonSchema):
    """None stands for a key that is left out, which a file cannot write; and titles would repeat the keys."""

    def nullable_schema(self, schema: core_schema.NullableSchema) -> JsonSchemaValue:
        """That of what is not None."""
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        """Without a default of None."""
        described = super().default_schema(schema)
        if described.get("default", 0) is None:
            del described["default"]
        return described

    def field_title_should_be_set(self, schema: object) -> bool:  # noqa: ARG002
        """Never."""
        return False


def json_schema() -> dict[str, Any]:
    """JSON Schema (2020-12) of the spacecraft file, for editors."""
    schema = SpacecraftFile.model_json_schema(schema_generator=_Schema)
    return {"$schema": _Schema.schema_dialect, **schema}
