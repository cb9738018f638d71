"""Friction and stiffness of a contact that depend on its temperature."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import Field, ValidationError, model_validator

from tribodyn.workflows.scene.fields import Number, Stiffness, Table, quantity

Change = Annotated[float, quantity("K")]
GIVEN = ("friction", "tangential_stiffness", "normal_stiffness")


class ByTemperature(Table):
    """Numbers of a contact at several changes of temperature, linear between them; none beyond their ends."""

    temperature: Annotated[tuple[Change, ...], Field(min_length=1)]
    """Changes of temperature, ascending, counted as those of the loads."""
    friction: tuple[Annotated[Number, Field(ge=0)], ...] | None = None
    """Coefficient of friction at each."""
    tangential_stiffness: tuple[Annotated[Stiffness, Field(ge=0)], ...] | None = None
    """Tangential stiffness of the contact at each."""
    normal_stiffness: tuple[Annotated[Stiffness, Field(ge=0)], ...] | None = None
    """Normal stiffness of the contact at each."""

    @model_validator(mode="after")
    def _columns(self) -> ByTemperature:
        if any(np.diff(self.temperature) <= 0):
            raise ValueError("temperature: give the changes of temperature in ascending order")
        if not self.columns:
            raise ValueError(f"give at least one of {', '.join(GIVEN)} at each temperature")
        for name, values in self.columns.items():
            if len(values) != len(self.temperature):
                raise ValueError(f"{name}: give {len(self.temperature)} values, one for each temperature")
        return self

    @property
    def columns(self) -> dict[str, tuple[float, ...]]:
        """The numbers that are given, by name."""
        return {name: values for name in GIVEN if (values := getattr(self, name)) is not None}

    def at(self, temperature: float) -> dict[str, float]:
        """The numbers at a change of temperature [K]; raises ValueError beyond the ends."""
        low, high = self.temperature[0], self.temperature[-1]
        if not low <= temperature <= high:
            raise ValueError(
                f"the contact is at {temperature:g} K, but by_temperature goes from {low:g} to {high:g} K: extend it"
            )
        return {name: float(np.interp(temperature, self.temperature, values)) for name, values in self.columns.items()}


class _OfContact(Table):
    temperature: Change | None = None
    by_temperature: ByTemperature


class _Heat(Table):
    temperature: Change


def with_numbers_when_hot(key: str, contact: Mapping[str, Any], static: Any) -> dict[str, Any]:
    """The table of a contact as it stands in the file, with the numbers of its temperature.

    key : of the contact; static : the table of the static loads
    Raises  ValueError where its temperature is not known or a number is given twice
    """
    own = {name: contact[name] for name in ("temperature", "by_temperature") if name in contact}
    try:
        read = _OfContact.model_validate(own)
    except ValidationError as error:  # before the numbers that it should have given are missed
        first = error.errors()[0]
        where = ".".join(str(part) for part in (key, *first["loc"]))
        raise ValueError(f"{where}: {first['msg'].removeprefix('Value error, ')}") from None
    try:
        found = read.by_temperature.at(_warmed(contact, static) if read.temperature is None else read.temperature)
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from None
    # a scene that was written out has the numbers beside the table
    twice = [name for name, value in found.items() if contact.get(name, value) not in (None, value)]
    if twice:
        raise ValueError(f"{key}.{twice[0]}: by_temperature gives it too: leave one of them out")
    return {**contact, **found}


def _warmed(contact: Mapping[str, Any], static: Any) -> float:
    """Mean over its two bodies of what the static loads heat them by [K]."""
    faces = [contact.get(one) for one in ("first", "second", "group", "opposite")]
    bodies = {str(face).partition(".")[0] for face in faces if isinstance(face, str) and face != "ground"}
    warmed = dict.fromkeys(bodies, 0.0)
    for load in static.values() if isinstance(static, Mapping) else ():
        if not isinstance(load, Mapping) or not {"temperature", "field"} & set(load):
            continue
        if "field" in load:
            raise ValueError("a field of temperatures heats its bodies: give the contact's own temperature")
        try:
            change = _Heat.model_validate({"temperature": load["temperature"]}).temperature
        except ValidationError:  # it is told where the load is read
            continue
        for body in bodies & set(load.get("bodies", bodies)):
            warmed[body] += change
    return sum(warmed.values()) / len(warmed)
