"""Random elastic robots and their frames of beam elements."""

from __future__ import annotations

from math import asin, cos, hypot, pi, sin

import numpy as np
from frame import SIGMA, Pipe, irsbot2_frame
from irsbot2_3d import Design

from irsbot_kinematics import stiffness
from irsbot_kinematics.mechanisms.irsbot2 import Irsbot2
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry
from irsbot_kinematics.stiffness import Irsbot2Structure, Material, Section
from irsbot_kinematics.stiffness.response import postures


def pipes_and_sections(rng, kinds):
    """Tubes of random sizes and materials, for the frame and for the structure."""
    pipes, sections = {}, {}
    for kind in kinds:
        outer, young, poisson = rng.uniform(0.02, 0.1), rng.uniform(2e10, 2.2e11), rng.uniform(0.1, 0.45)
        inner = outer * rng.uniform(0.0, 0.95)
        pipes[kind] = Pipe(outer, inner, young, poisson)
        sections[kind] = Section(outer, inner, Material(young, poisson, 2700.0))
    return pipes, sections


def random_irsbot2(rng, narrow=1.0):
    """An elastic IRSBot-2, a pose well inside its workspace, and the frame of both. narrow: share of the platform."""
    while True:
        g = Irsbot2Geometry(
            l1=rng.uniform(0.2, 0.5),
            l2eq=rng.uniform(0.6, 1.0),
            b=rng.uniform(0.05, 0.3),
            p=narrow * rng.uniform(0.02, 0.1),
            a1=rng.uniform(0.2, 0.5),
            a2=rng.uniform(0.02, 0.15),
            beta=rng.uniform(0.15, 1.2),
            e=rng.uniform(-0.1, 0.1),
        )
        robot = Irsbot2(g)
        mode = robot.working_modes[rng.integers(4)]
        pose = rng.uniform((-0.4, -1.1), (0.4, -0.4))
        pipes, sections = pipes_and_sections(rng, Irsbot2Structure.kinds)
        angle, d = rng.uniform(0.0, 2.0 * pi), rng.uniform(0.08, 0.3)
        spacing = 0.0 if rng.random() < 0.4 else rng.uniform(0.05, 0.5)
        u = (cos(angle), sin(angle))
        design = Irsbot2Structure("random", "", robot, sections, mode, {}, (), d, u, spacing)
        _, legs, status, reach = next(postures(design, pose[None, :]))
        if status[0] != 0 or reach[0] < 0.03 or legs.singular[0]:
            continue
        x, z = pose
        q, psi = [], []
        for sigma, w in zip(SIGMA, mode, strict=True):  # law of cosines, once more
            X, Z = x + sigma * g.b0, z + g.e
            r = hypot(X, Z)
            at_foot = np.arccos((r * r + g.l1**2 - g.l2eq**2) / (2.0 * g.l1 * r))
            toward = np.arctan2(-Z, X)
            q.append(toward + w * at_foot)
            psi.append(toward - w * asin(g.l1 * sin(at_foot) / g.l2eq))
            if g.l1 * np.cos(at_foot) > r:
                psi[-1] = toward - w * (pi - asin(g.l1 * sin(at_foot) / g.l2eq))
        q, psi = np.array(q), np.array(psi)
        flat = [abs(sin(angle) * cos(t) + cos(angle) * sin(t)) for t in q]
        answer = stiffness.evaluate_many(design, pose[None, :])
        if min(flat) < 0.2 or answer.status[0] != 0:
            continue
        d3 = Design(g.l1, g.l2eq, g.b, g.p, g.a1, g.a2, g.beta, g.e)
        return (
            design,
            pose,
            irsbot2_frame(d3, q, psi, pipes, d * np.array([u[0], 0.0, u[1]]), spacing),
            d3,
            q,
            psi,
            pipes,
        )
