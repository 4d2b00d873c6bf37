"""Any argument of stiffness, design, analysis, algebra replaced by any nonsense: a result, or a line of refusal."""

from __future__ import annotations

import importlib.util
import inspect
import warnings
from collections.abc import Callable
from functools import cache
from math import inf, nan
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import irsbot_kinematics as irs
from irsbot_kinematics import algebra, arguments, design, stiffness
from irsbot_kinematics.analysis import force_workspace as forces
from irsbot_kinematics.analysis import loops
from irsbot_kinematics.analysis import workspace_maps as maps

Right = dict[str, Any]
Table = dict[Callable[..., Any], Right]

NONSENSE: list[Any] = [
    None, 3, -1, 0, nan, inf, 1e300, 10**400, 1j, True, "x", b"x", {}, [], object(), (0.0, 0.0, 0.0), (nan, nan),
    [[1.0], [2.0, 3.0]], np.zeros((2, 2)), [None], ("a", "b"), {"x": 1}, {"x": object()}, {1: 2},
]  # fmt: skip

ROBOT = irs.make_robot("irsbot2")
M = ROBOT.mechanism
G = M.geometry
LOAD = forces.Load(10.0, 1.0, 100.0)
FORCE_BOX = maps.Box((0.0, 0.1), (-0.8, -0.7), ())


def of_stiffness() -> Table:
    D = stiffness.load("irsbot2_table2")
    pose, box, wrench = (0.0, -0.8), ((-0.1, 0.1), (-0.9, -0.8)), (0.0, 100.0, 0.0, 0.0, 0.0, 0.0)
    load, K = stiffness.Load(force_n=10.0), stiffness.matrix(D, pose)
    range_ = (0.02, 0.12)
    return {
        stiffness.matrix: {"design": D, "pose": pose},
        stiffness.compliance: {"design": D, "pose": pose},
        stiffness.deflection: {"design": D, "pose": pose, "wrench": wrench},
        stiffness.frequency: {"design": D, "pose": pose, "mass_kg": 1.0, "inertia": np.eye(3)},
        stiffness.evaluate_many: {"design": D, "poses": [pose]},
        stiffness.mass: {"design": D},
        stiffness.pose_errors: {"design": D, "poses": [pose], "load": load},
        stiffness.compliance_error: {"design": D, "load": load, "limits": design.Limits(), "box": box},
        stiffness.deflection_map: {"design": D, "wrench": wrench, "box": box, "nodes": (3, 3)},
        stiffness.index: {"deflections": {"a": [1.0, 2.0]}},
        stiffness.load: {"name_or_path": "irsbot2_table2", "robot": None, "beta": 0.3},
        stiffness.moved: {"K": K, "r": (0.0, 0.0, 0.1)},
        stiffness.turned: {"K": K, "R": np.eye(3)},
        stiffness.statistics: {"design": D, "poses": [pose]},
        stiffness.text_of: {"design": D},
        stiffness.tube_compliance: {"tube": stiffness.Tube(0.06, 0.05, 0.3, "aluminium")},
        stiffness.Tube: {"outer": 0.06, "inner": 0.05, "length": 0.3, "material": "aluminium", "rigid": False},
        stiffness.Material: {"young": 7e10, "poisson": 0.3, "density": 2700.0},
        stiffness.Load: {"force_n": 1.0, "moment_nm": 1.0, "payload_kg": 1.0, "gravity_m_s2": 9.8},
        stiffness.Task: {"start": D, "largest_m": 0.001, "outer": range_, "tubes": (), "lengths": {}, "generations": 1},
        stiffness.size: {"task": None},
        stiffness.presets: {},
        stiffness.materials: {},
        stiffness.table: {},
    }


def of_design() -> Table:
    d = design.Designs.of(G)
    strict = irs.make_robot("irsbot2_csc").mechanism.geometry
    held = design.singular_postures(strict)[0]
    fixed = design.Range(0.1, 0.2)
    return {
        design.check: {"g": G, "zone": "strict"},
        design.moves: {"g": G, "zone": "strict"},
        design.cells: {"g": G},
        **{
            f: {"d": d}
            for f in (design.evaluate_questions, design.bounds, design.counts, design.distal_free, design.judge)
        },
        **{f: {"d": d} for f in (design.evaluate_printed_zones, design.find_seats, design.table_3)},
        design.in_zone: {"zone": "strict", "found": design.evaluate_questions(d)},
        design.singular_postures: {"g": G},
        design.reachability: {"g": strict, "posture": held},
        design.largest_rectangle: {"robot": M, "limits": design.Limits(), "mode": (1, -1), "cells": (20, 40)},
        design.Range: {"low": 0.1, "high": 0.2, "steps": 3},
        design.Plan: {"ranges": dict.fromkeys(design.PARAMETERS, fixed), "samples": 2, "seed": 0},
        design.Task: {"size": 1.0, "slack": 0.002, "zone": "strict", "seed": 0, "generations": 1},
        design.search: {"task": None},
        design.sweep: {"plan": None, "chunk": 10},
    }


def of_analysis() -> Table:
    at = {"mechanism": M, "mode": (1, -1)}
    centre = {**at, "centre": (0.3, -0.75), "load": LOAD, "plane": (0, 1)}
    return {
        forces.Load: {"force_n": 1.0, "moment_nm": 1.0, "admissible_n": 1.0},
        forces.reaction_max_many: {**at, "poses": [(0.3, -0.75)], "load": LOAD},
        forces.admissible: {**at, "poses": [(0.3, -0.75)], "load": LOAD},
        forces.force_workspace: {**centre, "rays": 4, "step_m": 0.1},
        forces.reaction_map: {**centre, "first_m": (0.0, 0.1), "second_m": (-0.8, -0.7)},
        maps.workspace_map: {**at, "box": FORCE_BOX, "nodes": (3, 3)},
        maps.joint_map: {"mechanism": M, "assembly": -1, "box": FORCE_BOX, "nodes": (3, 3)},
        maps.reachable_box: {"mechanism": M, "others": ()},
        loops.circle: {"centre": (0.0, 0.0), "joints": (1, 2), "radius": 0.1, "start_rad": 0.0, "samples": 11},
    }


def of_algebra() -> Table:
    s = algebra.predefined("rprrp")
    at = dict.fromkeys(s.joints, 1.5)
    cells = algebra.decompose(s, s.joints, box=[(1, 2), (1, 2)])
    poses = [dict.fromkeys(s.pose, 1.0), dict.fromkeys(s.pose, 1.1)]
    return {
        algebra.real_roots: {"coefficients": [-2, 0, 1]},
        algebra.is_interval_empty: {"coefficients": [-2, 0, 1], "a": 0, "b": 1},
        algebra.predefined: {"name": "3rpr", "d1": "17.04"},
        algebra.configurations: {"system": s, "known": at, "constraints": True, "order": None},
        algebra.singularities: {"system": s, "kind": "parallel"},
        algebra.project: {"system": s, "kind": "parallel", "space": "joint", "fixed": None},
        algebra.constraint_equations: {"system": s},
        algebra.infinite_equations: {"system": s},
        algebra.of_robot: {"robot": irs.make_robot("rails2")},
        algebra.decompose: {"system": s, "names": s.joints, "box": [(1, 2), (1, 2)], "fixed": None, "digits": 6},
        algebra.cusps: {"system": s, "fixed": None, "space": "joint"},
        algebra.wall_counts: {"cells": cells},
        algebra.wall_vertices: {"cells": cells},
        algebra.pairing: {"system": s, "joint_cells": cells, "pose_cells": cells},
        algebra.image_of_path: {"system": s, "path": poses, "cells": None, "per_segment": 2},
        algebra.octree: {"system": s, "names": s.joints, "box": [(10, 11)] * 3, "depth": 0},
        algebra.System: {"equations": ["x^2+y^2=r^2", "x=y"], "pose": ["x", "y"], "joints": ["r"], "parameters": {}},
        algebra.names: {},
    }


TABLES: dict[str, tuple[ModuleType, Callable[[], Table]]] = {
    "stiffness": (stiffness, of_stiffness),
    "design": (design, of_design),
    "analysis": (forces, of_analysis),
    "algebra": (algebra, of_algebra),
}
needs_flint = pytest.mark.skipif(importlib.util.find_spec("flint") is None, reason="python-flint is an extra")


@cache
def table(name: str) -> Table:
    return TABLES[name][1]()


@pytest.mark.parametrize("name", [pytest.param(n, marks=needs_flint if n == "algebra" else ()) for n in TABLES])
def test_no_argument_can_cause_a_traceback(name: str) -> None:
    refused = 0
    for function, right in table(name).items():
        for argument in right:
            for value in NONSENSE:
                stated = outcome(function, {**right, argument: value})
                where = f"{function.__name__}({argument}={arguments.shown(value)}): {stated}"
                assert not stated.startswith("!"), where
                assert "\n" not in stated, where
                refused += bool(stated)
    assert refused > 20 * len(table(name))


def outcome(function: Callable[..., Any], given: Right) -> str:
    """The sentence of a refusal, empty for a result, a text that begins with ! for any other exception."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            function(**given)
    except irs.KinematicsError as error:
        return str(error)
    except Exception as error:
        return f"! {type(error).__name__}: {error}"
    return ""


@pytest.mark.parametrize("name", ["stiffness", "design", pytest.param("algebra", marks=needs_flint)])
def test_every_public_function_stands_in_the_tables(name: str) -> None:
    module = TABLES[name][0]
    public = {n for n in module.__all__ if inspect.isfunction(getattr(module, n))}
    assert public <= {function.__name__ for function in table(name)}


def test_what_an_annotation_asks_for() -> None:
    """The rule itself: numbers of numpy become plain ones, defaults are not checked."""

    @arguments.checked
    def asked(a: float, b: int = 1, c: tuple[float, float] | None = None, *, d: str = "x") -> tuple[Any, ...]:
        return a, b, c, d

    assert asked(np.float32(0.5), np.int8(2), np.array([1, 2]), d="y") == (0.5, 2, (1.0, 2.0), "y")
    assert [type(value) for value in asked(np.float32(0.5), np.int8(2))[:2]] == [float, int]
    for wrong in ({"a": "1"}, {"a": nan}, {"a": 1.0, "b": 1.5}, {"a": 1.0, "c": (1.0,)}, {"a": 1.0, "d": 1}):
        stated = outcome(asked, wrong)
        assert stated.split()[0] == next(reversed(wrong)), stated
