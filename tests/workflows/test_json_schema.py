"""The JSON schema of scenes is that of the program: it takes what the program takes and refuses what that refuses."""

import copy
import random
import tomllib
from collections.abc import Iterator
from typing import Any

import jsonschema
import pytest
import tomli_w

from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.json_schema import json_schema

NAMED = {"static", "harmonic", "contacts", "bodies", "materials", "faces", "face_sizes", "ties", "others", "fixed_axes"}
NAMED |= {"prescribed", "springs", "motion", "patterns", "decks"}


@pytest.fixture(scope="module")
def schema() -> jsonschema.Draft7Validator:
    result = json_schema()
    jsonschema.Draft7Validator.check_schema(result)
    return jsonschema.Draft7Validator(result)


def tables(name: str) -> dict[str, Any]:
    return tomllib.loads(scene_file.find(name).read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", scene_file.names())
def test_the_schema_accepts_every_scene_that_comes_along(name: str, schema: jsonschema.Draft7Validator) -> None:
    assert schema.is_valid(tables(name))


def test_every_key_of_the_schema_says_what_it_means() -> None:
    result = json_schema()
    for name, table in result["$defs"].items():
        for key, value in table["properties"].items():
            assert value.get("description") or value.get("$ref"), f"{name}.{key}"


def keys(table: dict[str, Any], path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Every key of a scene that is no name of its author's."""
    for key, value in table.items():
        if not path or path[-1] not in NAMED:
            yield (*path, key)
        if isinstance(value, dict):
            yield from keys(value, (*path, key))


def misspelt(word: str, draw: random.Random) -> str:
    """A word with one slip of the pen: a letter left out, doubled, exchanged with the next, or another one."""
    at = draw.randrange(len(word) - 1)
    slips = [word[:at] + word[at + 1 :], word[: at + 1] + word[at:], word[:at] + draw.choice("eionsx") + word[at + 1 :]]
    slips.append(word[:at] + word[at + 1] + word[at] + word[at + 2 :])
    return draw.choice([slip for slip in slips if slip != word])


def test_a_hundred_misspelt_keys_are_refused_with_the_right_one(schema: jsonschema.Draft7Validator) -> None:
    draw, right, refused = random.Random(1), 0, 0
    scenes = {name: tables(name) for name in ("beam", "blade", "leaf_seal", "rig", "turbine")}
    complete = sorted((name, path) for name, scene in scenes.items() for path in keys(scene) if len(path[-1]) > 3)
    for name, path in draw.sample(complete, 100):
        scene = copy.deepcopy(scenes[name])
        table = scene
        for key in path[:-1]:
            table = table[key]
        table[misspelt(path[-1], draw)] = table.pop(path[-1])
        refused += not schema.is_valid(scene)
        with pytest.raises(scene_file.SceneError) as message:
            scene_file.parse(tomli_w.dumps(scene), f"{name}.toml", (), scene_file.find(name).parent)
        right += f"did you mean {path[-1]}?" in str(message.value)
    assert refused == 100
    assert right >= 90
