"""The JSON schema of scenes, for editors that complete and check keys: made from the declarations that read a scene."""

import ast
import inspect
import sys
from collections.abc import Iterable, Mapping
from functools import cache
from itertools import pairwise
from typing import Any

from pydantic import BaseModel, TypeAdapter
from pydantic.json_schema import GenerateJsonSchema

from tribodyn.declarations import Number, read
from tribodyn.geometry import parts
from tribodyn.hbm import continuation
from tribodyn.workflows.scene.fields import IN_UNIT
from tribodyn.workflows.scene.matrix_scene import MatrixScene
from tribodyn.workflows.scene.schema import MeshScene
from tribodyn.workflows.scene.solution_tables import PartResponse
from tribodyn.workflows.scene.structure_tables import NamedContact
from tribodyn.workflows.scene.user_files import LawTable
from tribodyn.workflows.scene.wheel_scene import WheelScene

OWN_FILE = r"\.py$"


def json_schema() -> dict[str, Any]:
    """The schema of every kind of scene, draft 7: tables, keys, defaults, meanings, own numbers of parts and laws."""
    kinds: Any = MeshScene | WheelScene | MatrixScene
    schema = TypeAdapter(kinds).json_schema(schema_generator=_Generator)
    return {"$schema": "http://json-schema.org/draft-07/schema#", "title": "tribodyn scene"} | _plain(schema)


@cache
def meanings(kind: type[BaseModel]) -> dict[str, str]:
    """The text below every key of a table, from the source of its class and of those that it inherits from."""
    texts: dict[str, str] = {}
    for table in reversed(kind.__mro__):
        module = sys.modules[table.__module__]
        if not module.__name__.startswith("tribodyn"):
            continue
        written = ast.walk(ast.parse(inspect.getsource(module)))
        name = table.__name__.partition("[")[0]
        body = next((w.body for w in written if isinstance(w, ast.ClassDef) and w.name == name), [])
        for key, text in pairwise(body):
            if isinstance(key, ast.AnnAssign) and isinstance(key.target, ast.Name) and isinstance(text, ast.Expr):
                texts[key.target.id] = inspect.cleandoc(str(ast.literal_eval(text.value)))
    return texts


class _Generator(GenerateJsonSchema):
    """Keys with a unit take texts, tables with a law or a part its numbers, and every key says what it means."""

    def function_before_schema(self, schema: Any) -> dict[str, Any]:
        inner, function = self.generate_inner(schema["schema"]), schema["function"]["function"]
        table = getattr(function, "__self__", None)
        if table is not None and function.__name__ in table.__pydantic_decorators__.model_validators:
            return inner
        unit = getattr(function, IN_UNIT, None)
        if unit is None:  # a value with a short form: an axis, a place, a step
            return {"anyOf": [inner, {"type": ["string", "number", "array"]}]}
        return {"anyOf": [inner, {"type": "string"}], "description": f"[{unit or 'ratio'}]"}

    def model_schema(self, schema: Any) -> dict[str, Any]:
        kind, schema_of_table = schema["cls"], super().model_schema(schema)
        keys = schema_of_table.setdefault("properties", {})
        for name, text in meanings(kind).items():
            if name in keys:
                unit = keys[name].get("description", "")
                keys[name] = {**keys[name], "description": f"{' '.join(text.split())} {unit}".strip()}
        if issubclass(kind, PartResponse):  # that of the first harmonic load
            schema_of_table["required"] = ["frequency"]
        if issubclass(kind, NamedContact):
            for name, other in (("first", "group"), ("second", "opposite")):
                keys[name] = {"type": "string", "description": keys[other]["description"]}
            schema_of_table["required"] = [name for name in schema_of_table["required"] if name != "group"]
        if issubclass(kind, LawTable):
            files = {name: read(kind.LAWS.file_of(name)) for name in kind.LAWS.KIND.names()}
            _with_own(schema_of_table, "law", files)
            for name in ("parameters", "by_state"):  # of a wear rule, over a state: keys of the table
                keys.pop(name, None)
            for number in {n.name: n for own in (*files.values(), kind.OTHERS) for n in own}.values():
                keys[number.name] = {**keys[number.name], "type": ["number", "string", "object"]}
        elif "parameters" in keys:
            del keys["parameters"]
            _with_own(schema_of_table, "part", {name: read(parts.file_of(name)) for name in parts.names()})
        elif "options" in keys:
            numbers_of_methods = {name: continuation.declared(name) for name in continuation.KIND.names()}
            _with_own(keys["options"], "method", numbers_of_methods)
            keys["options"]["type"] = "object"
        return schema_of_table


def _with_own(schema: dict[str, Any], owner: str, files: Mapping[str, Iterable[Number]]) -> None:
    """Add the numbers that files declare to the keys of a table; a file beside the scene may have others."""
    keys = schema.setdefault("properties", {})
    if owner in keys:
        keys[owner]["examples"] = list(files)
    for name, numbers in files.items():
        for number in numbers:
            description = keys.get(number.name, {}).get("description")
            text = f"{owner} {name}: {number.meaning} [{number.unit or 'ratio'}]"
            keys[number.name] = {
                "type": ["number", "string"],
                "description": f"{description}; {text}" if description else text,
            }
    names = sorted(keys)
    if owner in keys:
        schema["additionalProperties"] = True
        schema["if"] = {"properties": {owner: {"type": "string", "pattern": OWN_FILE}}, "required": [owner]}
        schema["else"] = {"propertyNames": {"enum": names}}


def _plain(schema: Any) -> Any:
    """A schema without the titles that pydantic makes of names."""
    if isinstance(schema, dict):
        return {key: _plain(value) for key, value in schema.items() if key != "title" or not isinstance(value, str)}
    return [_plain(value) for value in schema] if isinstance(schema, list) else schema
