"""Systems of the shipped robots: the same closure equations, with the lengths of their files."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

from irsbot_kinematics.algebra.manipulators.delta import delta_system
from irsbot_kinematics.algebra.manipulators.planar import POINT_DIGITS, Leg, PlanarLegs, planar_drawing
from irsbot_kinematics.algebra.manipulators.two_dof import five_bar_drawing
from irsbot_kinematics.algebra.model.engine import AlgebraError
from irsbot_kinematics.algebra.model.exact import square_root, stored
from irsbot_kinematics.algebra.model.system import System
from irsbot_kinematics.arguments import instance

if TYPE_CHECKING:
    from irsbot_kinematics.mechanism import Mechanism
    from irsbot_kinematics.mechanisms.sliding_platform import SlidingPlatform
    from irsbot_kinematics.robot import Robot


def shipped_names() -> tuple[str, ...]:
    """Names of the shipped robots."""
    from irsbot_kinematics.robot import robots

    return robots()


def of_robot(robot: Robot) -> System:
    """The system of a robot, shipped or from a file. Raises AlgebraError for a mechanism without equations in this
    package.

    Lengths are the shortest decimals that print the floats; sines of 30 and 60 deg are rationalised to 40 digits.
    """
    from irsbot_kinematics.mechanisms.delta_family import DeltaFamily
    from irsbot_kinematics.mechanisms.planar_pair import PlanarPair
    from irsbot_kinematics.mechanisms.rrr3 import Rrr3
    from irsbot_kinematics.mechanisms.rrr3_base import Rrr3Base
    from irsbot_kinematics.mechanisms.ruu4 import Ruu4
    from irsbot_kinematics.mechanisms.sliding_platform import SlidingPlatform
    from irsbot_kinematics.robot import Robot

    mechanism = instance(robot, "robot", Robot, "a Robot; see make_robot").mechanism
    if isinstance(mechanism, PlanarPair):
        return _pair(robot.name, mechanism)
    if isinstance(mechanism, DeltaFamily):
        origins = [_vector(rail.origin) for rail in mechanism.rails]
        directions = [_vector(rail.direction) for rail in mechanism.rails]
        low, high = map(stored, mechanism.geometry.limits)
        joints = [joint.name for joint in mechanism.joints]
        return delta_system(
            robot.name, origins, directions, stored(mechanism.rod), low, high, joints, robot.description, "m"
        )
    if isinstance(mechanism, (Rrr3, Rrr3Base)):
        return _planar(robot.name, mechanism)
    if isinstance(mechanism, SlidingPlatform):
        return _sliding(robot, mechanism)
    if isinstance(mechanism, Ruu4):
        return _ruu(robot.name, mechanism)
    raise AlgebraError(f"{robot.name}: no equations for a mechanism of kind '{mechanism.kind}'; build a System")


def _vector(values: tuple[float, float, float]) -> tuple[Fraction, Fraction, Fraction]:
    x, y, z = map(stored, values)
    return x, y, z


def _pair(name: str, mechanism: Mechanism) -> System:
    loop = mechanism.loop  # type: ignore[attr-defined]
    q1, q2 = (joint.name for joint in mechanism.joints)
    drawing = five_bar_drawing(-1)
    points = {key: tuple(t.replace("q1", q1).replace("q2", q2) for t in p) for key, p in drawing.points.items()}
    points |= {key: (p[0], f"{p[1]} - e") for key, p in points.items() if key != "P"}
    return System(
        [
            f"(x + b - l1*cos({q1}))^2 + (z + e + l1*sin({q1}))^2 = l2^2",
            f"(x - b - l1*cos({q2}))^2 + (z + e + l1*sin({q2}))^2 = l2^2",
        ],
        pose=["x", "z"],
        joints=[q1, q2],
        angles=[q1, q2],
        parameters={
            "b": stored(loop.half_base),
            "e": stored(loop.drop),
            "l1": stored(loop.crank),
            "l2": stored(loop.rod),
        },
        name=name,
        description="equivalent five-bar",
        units={"x": "m", "z": "m", q1: "rad", q2: "rad"},
        drawing=type(drawing)(points, drawing.chains, drawing.loops, drawing.actuators),
    )


def _planar(name: str, mechanism: Mechanism) -> System:
    from irsbot_kinematics.mechanisms.rrr3 import Rrr3

    joints = [joint.name for joint in mechanism.joints]
    parameters: dict[str, Fraction] = {}
    g = mechanism.geometry
    if isinstance(mechanism, Rrr3):
        h = square_root(Fraction(3, 4), POINT_DIGITS)
        corners = [(-h, Fraction(-1, 2)), (h, Fraction(-1, 2)), (Fraction(0), Fraction(1))]
        feet = [(stored(g.rb) * x, stored(g.rb) * y) for x, y in corners]
        ends = [(stored(g.rp) * x, stored(g.rp) * y) for x, y in corners]
        parameters["l"] = stored(g.l)
    else:
        feet = [(stored(x), stored(y)) for x, y in (g.a1, g.a2, g.a3)]
        ends = [(stored(x), stored(y)) for x, y in (g.b1, g.b2, g.b3)]
        parameters |= {"l1": stored(g.l1), "l2": stored(g.l2)}
    legs = []
    for i, ((fx, fy), (bx, by), q) in enumerate(zip(feet, ends, joints, strict=True), 1):
        parameters |= {f"a{i}x": fx, f"a{i}y": fy, f"b{i}x": bx, f"b{i}y": by}
        if isinstance(mechanism, Rrr3):
            legs.append(Leg(f"b{i}x", f"b{i}y", f"a{i}x", f"a{i}y", f"2*l^2*(1 + cos({q}))"))
        else:
            legs.append(Leg(f"b{i}x", f"b{i}y", f"a{i}x + l1*cos({q})", f"a{i}y + l1*sin({q})", "l2^2"))
    return System(
        [leg.equation for leg in legs],
        pose=["x", "y", "phi"],
        joints=joints,
        angles=["phi", *joints],
        parameters=parameters,
        name=name,
        description="planar 3-RRR",
        units={"x": "m", "y": "m", "phi": "rad"} | dict.fromkeys(joints, "rad"),
        drawing=planar_drawing(legs, [(f"a{i}x", f"a{i}y") for i in (1, 2, 3)]),
        structure=PlanarLegs((legs[0], legs[1], legs[2])),
    )


def _sliding(robot: Robot, mechanism: SlidingPlatform) -> System:
    joints = [joint.name for joint in mechanism.joints]
    parameters: dict[str, Fraction] = {}
    legs, inequalities = [], []
    columns = zip(mechanism.feet, mechanism.corners, mechanism.rails, joints, strict=True)
    for i, ((ox, oy), (bx, by), rail, q) in enumerate(columns, 1):
        places = {f"o{i}x": ox, f"o{i}y": oy, f"b{i}x": bx, f"b{i}y": by}
        near, square = (f"o{i}x", f"o{i}y"), f"{q}^2"
        if rail is None:
            inequalities.append(f"{q} > 0")
        else:
            places |= {f"u{i}x": rail.way[0], f"u{i}y": rail.way[1], f"L{i}": rail.rod}
            near, square = (f"o{i}x + {q}*u{i}x", f"o{i}y + {q}*u{i}y"), f"L{i}^2"
        parameters |= {key: stored(value) for key, value in places.items()}
        legs.append(Leg(f"b{i}x", f"b{i}y", *near, square))
    return System(
        [leg.equation for leg in legs],
        pose=["x", "y", "phi"],
        joints=joints,
        angles=["phi"],
        parameters=parameters,
        inequalities=inequalities,
        name=robot.name,
        description=robot.description,
        units={"x": "m", "y": "m", "phi": "rad"} | dict.fromkeys(joints, "m"),
        drawing=planar_drawing(legs, [(f"o{i}x", f"o{i}y") for i in (1, 2, 3)]),
        structure=PlanarLegs((legs[0], legs[1], legs[2])),
    )


def _ruu(name: str, mechanism: Mechanism) -> System:
    g = mechanism.geometry
    joints = [joint.name for joint in mechanism.joints]
    equations = []
    for (ux, uy), q in zip(((1, 0), (0, 1), (-1, 0), (0, -1)), joints, strict=True):
        x = f"x + rp*({ux}*cos(phi) - ({uy})*sin(phi)) - rb*({ux}) - l1*cos({q})"
        y = f"y + rp*({ux}*sin(phi) + ({uy})*cos(phi)) - rb*({uy}) - l1*sin({q})"
        equations.append(f"({x})^2 + ({y})^2 + z^2 = l2^2")
    return System(
        equations,
        pose=["x", "y", "z", "phi"],
        joints=joints,
        angles=["phi", *joints],
        parameters={key: stored(getattr(g, key)) for key in ("rb", "rp", "l1", "l2")},
        name=name,
        description="4-RUU, three translations and a turn about z",
        units={"x": "m", "y": "m", "z": "m", "phi": "rad"} | dict.fromkeys(joints, "rad"),
    )
