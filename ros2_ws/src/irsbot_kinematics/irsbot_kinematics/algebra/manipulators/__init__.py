"""The predefined manipulators of [S4], section 2.4, and the bridge from the shipped robots."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from irsbot_kinematics.algebra.manipulators import delta, planar, serial, spatial, two_dof
from irsbot_kinematics.algebra.manipulators.shipped import of_robot, shipped_names
from irsbot_kinematics.algebra.model.engine import AlgebraError
from irsbot_kinematics.algebra.model.exact import exact
from irsbot_kinematics.algebra.model.system import System
from irsbot_kinematics.arguments import checked

MAKERS: dict[str, Callable[..., System]] = {
    "3rpr": planar.rpr3,
    "3rpr_full": planar.rpr3_full,
    "3prr": planar.prr3,
    "rpr_2prr": planar.rpr_2prr,
    "prp_2prr": planar.prp_2prr,
    "rprrp": two_dof.rprrp,
    "prrp": two_dof.prrp,
    "rr_rrr": two_dof.rr_rrr,
    "3ppps": spatial.ppps3,
    "3prs_v": spatial.prs3_upright,
    "3prs_h": spatial.prs3_level,
    "serial_3r": serial.serial_3r,
    "orthoglide": delta.orthoglide,
    "hybridglide": delta.hybridglide,
    "triaglide": delta.triaglide,
    "uranesx": delta.uranesx,
}


def names() -> tuple[str, ...]:
    """Names for `predefined`: the manipulators of [S4] first, then the shipped robots."""
    return (*MAKERS, *(name for name in shipped_names() if name not in MAKERS))


@checked
def predefined(name: str, **lengths: Any) -> System:
    """A manipulator by name; lengths as int, str, Fraction or short decimal replace the defaults, exactly.

    predefined("3rpr", d1="17.04"). Raises AlgebraError for unknown names and lengths.
    """
    if name in MAKERS:
        maker = MAKERS[name]
        try:
            return maker(**lengths)
        except TypeError:
            import inspect

            known = ", ".join(inspect.signature(maker).parameters)
            lost = [key for key in lengths if key not in inspect.signature(maker).parameters]
            if not lost:
                raise
            raise AlgebraError(f"{name} has no length '{lost[0]}'; it has {known}") from None
    if name in shipped_names():
        from irsbot_kinematics.robot import make_robot

        return of_robot(make_robot(name, **{key: float(exact(value, key)) for key, value in lengths.items()}))
    raise AlgebraError(f"no manipulator '{name}'; known are {', '.join(names())}")
