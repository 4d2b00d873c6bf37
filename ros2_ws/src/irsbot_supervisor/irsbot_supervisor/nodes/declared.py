"""Declares parameters with their ranges, and converts values to the declared types: the `ros2` tools and parameter
files guess the type from the text, read 2 as an integer, and write 0.00001 as 1e-05, which YAML reads as a string. A
value that can only have the declared type is converted to it, at the start and in a set call alike."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from irsbot_msgs_py.process.usage import UsageError

Limits = tuple[float, float]
"""Smallest and largest value."""


def descriptor(text: str, limits: Limits | None = None, *, read_only: bool = True) -> ParameterDescriptor:
    """Description of a parameter. limits: two integers for an integer."""
    described = ParameterDescriptor(description=text, read_only=read_only)
    match limits:
        case (int(low), int(high)):
            described.integer_range = [IntegerRange(from_value=low, to_value=high)]
        case (low, high):
            described.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    return described


def declare(node: Node, name: str, default: Any, described: ParameterDescriptor) -> Any:
    """Declare a parameter and return its value. Raises UsageError for a number outside of the range, and what
    `declare_parameter` raises."""
    try:
        return node.declare_parameter(name, default, described).value
    except (InvalidParameterTypeException, InvalidParameterValueException):
        # What is given can be seen only where every type and every value is allowed.
        given = node.declare_parameter(name, None, ParameterDescriptor(dynamic_typing=True))
        node.undeclare_parameter(name)
    value = _as(Parameter.Type.from_parameter_value(default), given).value
    for limits in (*described.floating_point_range, *described.integer_range):
        low, high = limits.from_value, limits.to_value
        if isinstance(value, (int, float)) and not low <= value <= high:
            raise UsageError(f"{name} is {value!r}, must be in {low:g}..{high:g}")
    return node.declare_parameter(name, value, described, ignore_override=True).value


SCALARS = (Parameter.Type.DOUBLE, Parameter.Type.INTEGER, Parameter.Type.STRING)
"""Types of a number that a tool or a file may give."""


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
        case Parameter.Type.DOUBLE_ARRAY if given.type_ in SCALARS:  # one value for all joints
            return _array(given, [value])
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
