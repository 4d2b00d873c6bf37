"""Arguments of the commands `algebra`: manipulators, fixed variables, ranges, pictures."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any

import typer

from irsbot_kinematics import BadInput
from irsbot_kinematics import algebra as al
from irsbot_kinematics.description import yaml_text
from irsbot_supervisor.cli.common import robot_named

Name = Annotated[str, typer.Argument(help="manipulator (see `irsbot algebra names`), robot file, or file of equations")]

Fix = Annotated[list[str] | None, typer.Option("--fix", help="fixed variable, such as rho1=17; once for each")]
Box = Annotated[list[str] | None, typer.Option("--box", help="range, such as rho2=0.1:45; once for each")]
Lengths = Annotated[list[str] | None, typer.Option("--set", help="length of the manipulator, such as d1=17.04")]
Plot = Annotated[Path | None, typer.Option("--plot", help="picture: .png, .svg, .pdf; surfaces also .html")]
AsJson = Annotated[bool, typer.Option("--json", help="print JSON")]
Kind = Annotated[str, typer.Option(help="parallel or serial")]
Space = Annotated[str, typer.Option(help="joint or pose")]


def system_of(name: str, lengths: list[str] | None) -> al.System:
    """The equations of a predefined manipulator, of a robot file, or of a file of equations.

    lengths: values of --set for the lengths of a predefined manipulator, or parameters of a file of equations. Raises
    BadInput for an unknown name and for a malformed file.
    """
    stated = _pairs(lengths, "--set", "d1=17.04")
    if name in al.names():
        return al.predefined(name, **stated)
    path = Path(name)
    if path.suffix in (".yaml", ".yml"):
        try:
            text = yaml_text.parsed(path.read_text(encoding="utf-8"), name)
        except UnicodeDecodeError:
            raise BadInput(f"{name}: not a text in UTF-8") from None
        if isinstance(text, dict) and "equations" in text:
            return _equations(name, text, stated)
        return al.of_robot(robot_named(name))
    return al.predefined(name)


def _equations(name: str, text: dict[str, Any], lengths: dict[str, str]) -> al.System:
    known = {
        "equations",
        "inequalities",
        "pose",
        "joints",
        "passive",
        "angles",
        "parameters",
        "name",
        "description",
        "units",
    }
    lost = sorted(set(map(str, text)) - known)
    if lost:
        raise BadInput(f"{name}: unknown key '{lost[0]}'; known are {', '.join(sorted(known))}")
    for key in ("pose", "joints"):
        if key not in text:
            raise BadInput(f"{name}: the key '{key}' is missing")
    parameters = {**(text.get("parameters") or {}), **lengths}
    try:
        return al.System(**{"name": Path(name).stem, **text, "parameters": parameters})
    except (TypeError, AttributeError) as error:
        raise BadInput(f"{name} is malformed: {error}; lists of texts and a mapping of parameters are wanted") from None


def _pairs(stated: list[str] | None, option: str, example: str) -> dict[str, str]:
    found = {}
    for text in stated or []:
        name, equals, value = text.partition("=")
        if not equals or not name or not value:
            raise BadInput(f"{option} must look like {example}, got '{text}'")
        found[name.strip()] = value.strip()
    return found


def fixed_in(stated: list[str] | None) -> dict[str, Any]:
    """Values of --fix as rational texts, by variable. Raises BadInput."""
    return dict(_pairs(stated, "--fix", "rho1=17"))


def boxes_in(stated: list[str] | None) -> dict[str, tuple[str, str]]:
    """Values of --box: least and greatest value as rational texts, by variable in the given order. Raises BadInput."""
    found = {}
    for name, value in _pairs(stated, "--box", "rho2=0.1:45").items():
        low, colon, high = value.partition(":")
        if not colon:
            raise BadInput(f"--box must look like rho2=0.1:45, got '{name}={value}'")
        try:
            Fraction(low), Fraction(high)
        except (ValueError, ZeroDivisionError):
            raise BadInput(f"each end of --box must be a number, as in rho2=0.1:45, got '{name}={value}'") from None
        found[name] = (low, high)
    return found


def picture_named(path: Path, *, page: bool = False) -> Path:
    """The path of a picture whose format can be written. page: True if .html is one of them. Raises BadInput."""
    if path.suffix not in (".png", ".svg", ".pdf") and not (page and path.suffix == ".html"):
        raise BadInput(
            f"cannot draw '{path}': the suffix must be .png, .svg or .pdf{' (.html for surfaces)' if page else ''}"
        )
    return path
