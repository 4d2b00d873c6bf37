"""Converts parameter values of the `ros2` tools: they guess the type from the text, and write 0.00001 as 1e-05, which
YAML reads as a string. A value that can only have the declared type is converted to it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rclpy.node import Node
from rclpy.parameter import Parameter


def read_as_declared(node: Node) -> None:
    """Convert from now on, before every check of parameters that are set. Call it when all parameters are declared."""
    node.add_pre_set_parameters_callback(lambda parameters: as_declared(node, parameters))


def as_declared(node: Node, parameters: list[Parameter]) -> list[Parameter]:
    """The same parameters with the declared types, where the values allow it."""
    return [_as(node.get_parameter(p.name).type_, p) if node.has_parameter(p.name) else p for p in parameters]


def _as(declared: Any, given: Parameter) -> Parameter:
    """The parameter with the declared type, or unchanged if it cannot be converted."""
    value: Any = given.value
    match declared:
        case given.type_:
            return given
        case Parameter.Type.DOUBLE if given.type_ in (Parameter.Type.INTEGER, Parameter.Type.STRING):
            number = _number(value)
            return given if number is None else Parameter(given.name, declared, number)
        case Parameter.Type.DOUBLE_ARRAY if given.type_ in (Parameter.Type.INTEGER_ARRAY, Parameter.Type.STRING_ARRAY):
            return _array(given, value)
        case Parameter.Type.STRING if value is False:  # the bare word `off`, or `no`
            return Parameter(given.name, declared, "none")
    return given


def _array(given: Parameter, values: Iterable[Any]) -> Parameter:
    numbers = [_number(value) for value in values]
    return given if None in numbers else Parameter(given.name, Parameter.Type.DOUBLE_ARRAY, numbers)


def _number(value: Any) -> float | None:
    try:
        return float(value)
    except (ValueError, OverflowError):
        return None
