"""The reference of model and experiment files, from their JSON schema."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

Schema = dict[str, Any]
BEGIN = """# Model file

A model file is TOML: a robot, its actuators, its free parameters, and what is known of its sensors and logs. An
experiment is a model file with a controller, its fitness, a reality and the searches
([how to co-evolve](../howto/coevolve.md)). This page is made from the JSON schema, which `btr schema`
prints. With it, editors complete such files:

```toml fragment
#:schema btr.schema.json
name = "arm"
```

Keys without a default are required where the type does not say *optional*.
"""


def page(path: Path) -> str:
    """The tables of the file, then the types that they use."""
    schema = json.loads(path.read_text(encoding="utf-8"))
    types: dict[str, Schema] = schema["$defs"]
    parts = [BEGIN, "\n## The whole file\n", _table(schema)]
    for name, definition in types.items():
        parts += [f"\n## {name}\n", *_described(definition)]
    return "\n".join(parts) + "\n"


def _described(definition: Schema) -> Iterator[str]:
    yield _text(definition) + "\n"
    if "properties" in definition:
        yield _table(definition)
    cases = definition.get("oneOf") or definition.get("anyOf") or []
    for case in cases:
        if "properties" in case:
            yield f"\n**`{_case(case)}`** {_text(case)}\n"
            yield _table(case, leave_out=_case_key(case))
    simple = [case for case in cases if "properties" not in case]
    if simple:
        yield "\n".join(f"- {_type(case)}: {_text(case)}" for case in simple) + "\n"
    if "enum" in definition:
        yield _type(definition) + "\n"


def _case_key(case: Schema) -> str | None:
    return next((key for key, value in case["properties"].items() if "const" in value), None)


def _case(case: Schema) -> str:
    key = _case_key(case)
    return f'{key} = "{case["properties"][key]["const"]}"' if key else " or ".join(case["properties"])


def _table(schema: Schema, leave_out: str | None = None) -> str:
    rows = ["| key | type | default | what |", "|---|---|---|---|"]
    for key, value in schema["properties"].items():
        if key != leave_out:
            optional = key not in schema.get("required", []) and "default" not in value
            kind = _type(value) + (", optional" if optional and "null" not in _type(value) else "")
            rows.append(f"| `{key}` | {kind.replace(' or null', ', optional')} | {_default(value)} | {_text(value)} |")
    return "\n".join(rows) + "\n" if len(rows) > 2 else ""


def _default(value: Schema) -> str:
    default = value.get("default")
    if default is None or default == {} or default == [] or "default" not in value:
        return ""
    return "see the type" if isinstance(default, dict) else f"`{json.dumps(default)}`"


def _type(value: Schema) -> str:
    if "$ref" in value:
        name = value["$ref"].rsplit("/", 1)[1]
        return f"[{name}](#{name.lower()})"
    if "const" in value:
        return f'`"{value["const"]}"`'
    if "enum" in value:
        return " or ".join(f'`"{choice}"`' for choice in value["enum"])
    for union in ("anyOf", "oneOf"):
        if union in value:
            return " or ".join(_type(case) for case in value[union])
    kind = value.get("type", "any value")
    if isinstance(kind, list):
        return " or ".join(_type({**value, "type": one}) if one != "null" else one for one in kind)
    if kind == "array":
        many = f"{value['minItems']} × " if "minItems" in value else "list of "
        return many + _type(value.get("items", {}))
    if kind == "object":
        inner = value.get("additionalProperties")
        return f"table of {_type(inner)}" if isinstance(inner, dict) else "table"
    return {"string": "text", "boolean": "`true` or `false`"}.get(str(kind), str(kind))


def _text(value: Schema) -> str:
    text = re.sub(r"\s*\n\s*", " ", value.get("description", ""))
    # Braces and bars would be read as attributes and cells.
    return text.replace("|", "\\|")
