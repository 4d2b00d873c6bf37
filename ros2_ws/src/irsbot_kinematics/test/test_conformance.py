"""The conformance test: every shipped robot passes it, and every way of being wrong is caught by the law it breaks."""

from __future__ import annotations

from math import radians, sin

import pytest

import irsbot_kinematics as irs
from irsbot_kinematics.conformance import LAWS, conformance
from irsbot_kinematics.conformance.samples import Machine
from irsbot_kinematics.conformance.singular import singular_answered
from irsbot_kinematics.mechanism import CertifiedBounds, Mechanism, Status
from irsbot_kinematics.mechanisms.delta_kinematics import DeltaGeometry
from irsbot_kinematics.mechanisms.orthoglide import Orthoglide
from irsbot_kinematics.mechanisms.rrr3_base import Rrr3Base
from irsbot_kinematics.numerics.arithmetic import ARRAYS

pytestmark = pytest.mark.slow

GEOMETRY = DeltaGeometry(2.0, (0.0, 4.0))


@pytest.mark.parametrize("name", irs.robots())
def test_every_shipped_robot_keeps_every_law(name):
    robot = irs.make_robot(name)
    checks = list(conformance(robot, joints=30 if robot.mechanism.label_is_invariant else 25))
    assert [check.law for check in checks] == ["postures", *[entry.name for entry in LAWS]]
    assert [check.broken for check in checks if check.broken] == []
    assert all(check.tried > 0 and check.words for check in checks)


# --- mechanisms that are wrong in one thing ---


class Plain(Orthoglide):
    """Postures from `direct` and `legs` alone, as of a mechanism that does not override `posture`."""

    def posture(self, joints, assembly):
        return Mechanism.posture(self, joints, assembly)


class OtherLegs(Orthoglide):
    """`posture` is right, `legs` is not."""

    def legs(self, k, joints, pose):
        legs = super().legs(k, joints, pose)
        legs.levers = tuple(-lever for lever in legs.levers)
        return legs


class WrongScrew(Plain):
    def legs(self, k, joints, pose):
        legs = super().legs(k, joints, pose)
        (x, y, z), *others = legs.screws
        legs.screws = ((-x, y, z), *others)
        return legs


class WrongLever(Plain):
    def legs(self, k, joints, pose):
        legs = super().legs(k, joints, pose)
        first, *others = legs.levers
        legs.levers = (-first, *others)
        return legs


class LongScrew(Plain):
    def legs(self, k, joints, pose):
        legs = super().legs(k, joints, pose)
        legs.screws = tuple(tuple(2.0 * value for value in row) for row in legs.screws)
        legs.levers = tuple(2.0 * lever for lever in legs.levers)
        legs.closure = tuple(2.0 * error for error in legs.closure)
        return legs


class LargeSine(Plain):
    def legs(self, k, joints, pose):
        legs = super().legs(k, joints, pose)
        legs.normalised_levers = tuple(1.5 * sine for sine in legs.normalised_levers)
        return legs


class BentSine(Plain):
    def legs(self, k, joints, pose):
        legs = super().legs(k, joints, pose)
        legs.normalised_levers = tuple(sine * k.abs(sine) for sine in legs.normalised_levers)
        return legs


class WrongMany(Orthoglide):
    def legs(self, k, joints, pose):
        legs = super().legs(k, joints, pose)
        if k is ARRAYS:
            legs.normalised_levers = tuple(sine * (1.0 - 1e-6) for sine in legs.normalised_levers)
        return legs


class OpenInverse(Orthoglide):
    def inverse(self, k, pose, mode):
        joints, reach = super().inverse(k, pose, mode)
        return tuple(q + 1e-6 for q in joints), reach


class SwappedModes(Orthoglide):
    def inverse(self, k, pose, mode):
        return super().inverse(k, pose, tuple(-sign for sign in mode))


class ReachesEverything(Orthoglide):
    def inverse(self, k, pose, mode):
        joints, reach = super().inverse(k, pose, mode)
        return joints, tuple(k.abs(value) for value in reach)


class HalfOfTheAssemblies(Orthoglide):
    def __init__(self, geometry):
        super().__init__(geometry)
        self.assembly_modes = (-1,)


class NoBias(Orthoglide):
    def bias(self, at, joint_rates, pose_rates):
        return (0.0, 0.0, 0.0)


class Optimistic(Orthoglide):
    def certified_bounds(self, at, travel, slack_m=0.0):
        bound = super().certified_bounds(at, travel, slack_m)
        return bound._replace(type2=min(at.type2, 1.2 * bound.type2))


class OptimisticSharp(Orthoglide):
    """Believes that the joints move half as far as they may."""

    def sharp_bounds(self, at, travel, slack_m=0.0):
        return super().sharp_bounds(at, [0.5 * t for t in travel], slack_m)


class PromisesUnknownSharp(Orthoglide):
    def sharp_bounds(self, at, travel, slack_m=0.0):
        if any(t == float("inf") for t in travel):
            return CertifiedBounds(at.type1, at.type2, at.constraint, at.limb)
        return super().sharp_bounds(at, travel, slack_m)


class PromisesUnknown(Orthoglide):
    def certified_bounds(self, at, travel, slack_m=0.0):
        if any(t != t for t in travel):
            return CertifiedBounds(at.type1, at.type2, at.constraint, at.limb)
        return super().certified_bounds(at, travel, slack_m)


class PromisesNothing(Orthoglide):
    def certified_bounds(self, at, travel, slack_m=0.0):
        return self._nothing


class TooClear(Orthoglide):
    def clearance(self, at):
        return 1.05 * min(at.reach)


class BelievesNan(Orthoglide):
    def posture(self, joints, assembly):
        if any(q != q for q in joints):
            return super().posture((1.5, 1.5, 1.5), assembly)
        return super().posture(joints, assembly)


class Jumps(Plain):
    """Changes its branch with a joint: the sign of a label does not last."""

    def direct(self, k, joints, assembly):
        return super().direct(k, joints, assembly if float(joints[0]) % 0.05 < 0.025 else -assembly)


class DividesByTheLever(Orthoglide):
    """0/0 where a rod is at right angles to its rail."""

    def clearance(self, at):
        return super().clearance(at) * min(at.type1) / min(at.type1)


class NothingIsKnownWhenFolded(Orthoglide):
    def certified_bounds(self, at, travel, slack_m=0.0):
        bound = super().certified_bounds(at, travel, slack_m)
        return bound if min(at.type1) > 1e-6 else bound._replace(type2=float("nan"))


class ForgetsTheSlack(Orthoglide):
    """Promises for a machine that is off what holds for the exact one."""

    def certified_bounds(self, at, travel, slack_m=0.0):
        return super().certified_bounds(at, travel, 0.0)

    def sharp_bounds(self, at, travel, slack_m=0.0):
        return super().sharp_bounds(at, travel, 0.0)


class GapsThatStay(Orthoglide):
    """Says of every pose that the legs are far from coming apart."""

    def direct(self, k, joints, assembly):
        pose, (slack, apart) = super().direct(k, joints, assembly)
        return pose, (k.maximum(slack, 0.5 + 0.0 * slack), apart)


class Raises(Orthoglide):
    def bias(self, at, joint_rates, pose_rates):
        raise ZeroDivisionError("float division by zero")


WRONG = {
    OtherLegs: "posture is legs",
    WrongScrew: "Jacobian by pose",
    WrongLever: "Jacobian by joints",
    LongScrew: "unit screws",
    LargeSine: "margins in 0..1",
    BentSine: "Type 1 is the lever",
    WrongMany: "many are single",
    OpenInverse: "inverse closes",
    SwappedModes: "inverse keeps its mode",
    ReachesEverything: "refusals",
    HalfOfTheAssemblies: "direct gives back",
    NoBias: "direct rates and bias",
    Optimistic: "guarantee is kept",
    OptimisticSharp: "sharp guarantee is kept",
    PromisesUnknown: "unknown is unknown",
    PromisesUnknownSharp: "unknown is unknown",
    BelievesNan: "unknown is unknown",
    PromisesNothing: "guarantee says something",
    TooClear: "clearance is kept",
    Jumps: "branch goes on",
    DividesByTheLever: "singular postures are answered",
    NothingIsKnownWhenFolded: "singular postures are answered",
    ForgetsTheSlack: "guarantee of wrong machines is kept",
    GapsThatStay: "gaps refuse what does not close",
    Raises: "direct rates and bias",
}


@pytest.mark.parametrize("wrong", WRONG, ids=lambda cls: cls.__name__)
def test_a_mistake_breaks_its_law_with_place_and_numbers(wrong):
    _, check = conformance(irs.Robot(wrong(GEOMETRY)), joints=60, only=[WRONG[wrong]])
    stated = check.broken
    assert stated
    assert "\n" not in stated
    assert any(char.isdigit() for char in stated)
    assert ("Error" in stated) == (wrong in (Raises, DividesByTheLever))
    assert "allowed" in stated or wrong is Raises


def test_the_same_laws_hold_where_nothing_is_wrong():
    assert not [check.broken for check in conformance(irs.Robot(Orthoglide(GEOMETRY)), joints=60) if check.broken]


CORNERS = ((-0.3, -0.2), (0.3, -0.2), (0.05, 0.35))
DEGENERATE = {
    "congruent triangles, every leg folded to nothing": (
        "rrr3_base",
        {f"{which}{i}": corner for which in "ab" for i, corner in enumerate(CORNERS, 1)},
    ),
    "4-RUU with equal radii and links": ("ruu4", {"rb": 0.3, "rp": 0.3, "l1": 0.4, "l2": 0.4}),
    "3-RRR with equal triangles": ("rrr3", {"rb": 0.3, "rp": 0.3}),
    "five-bar with equal links": ("five_bar", {"l1": 0.4, "l2": 0.4, "b": 0.2}),
    "five-bar that just reaches": ("five_bar", {"l1": 0.1, "l2": 0.4, "b": 0.5}),
    "IRSBot-2 whose rods can vanish": ("irsbot2", {"l1": 0.3, "l2eq": 0.39 * sin(radians(10.0))}),
    "two slides on one rail": ("linear_delta", {"o2": (0.25, 0.0, 0.0)}),
}


@pytest.mark.parametrize("name", DEGENERATE)
def test_machines_that_are_often_singular_are_answered_too(name):
    preset, lengths = DEGENERATE[name]
    cases = list(singular_answered(Machine(irs.make_robot(preset, **lengths), 30, 2)))
    assert [case.stated for case in cases if not case.error <= 1e-9] == []
    assert cases


def test_the_posture_with_a_leg_folded_to_nothing_is_answered():
    """Crank end and platform joint of leg 1 meet its base joint: joints as a user gave them."""
    robot = irs.make_robot("rrr3_base")
    found = robot.evaluate((0.0, -2.0042699833528625, -0.9570724321562651), 1)
    assert found.type1_margin[0] < 1e-9
    assert 0.0 <= found.clearance < 1e-15
    assert found.type2_margin > 0.3


def test_a_mechanism_without_assembled_postures_is_reported_and_no_other_law_is_tried():
    class Apart(Orthoglide):
        def posture(self, joints, assembly):
            return self._undetermined(Status.UNREACHABLE, tuple(joints), (-1.0, 1.0))

    (check,) = conformance(irs.Robot(Apart(GEOMETRY)), joints=20)
    assert check.law == "postures"
    assert "0 postures at 20 random joint positions" in check.broken


def test_an_error_in_posture_is_reported_and_not_raised():
    class Broken(Orthoglide):
        def posture(self, joints, assembly):
            raise IndexError("tuple index out of range")

    (check,) = conformance(irs.Robot(Broken(GEOMETRY)), joints=20)
    assert "IndexError: tuple index out of range" in check.broken


class ForgottenLabels(Rrr3Base):
    """Six assembly modes whose labels change places along motions free of Type 2: `track` must follow them."""

    kind = "forgotten_labels"
    label_is_invariant = True

    def track(self, joints, previous):
        return Mechanism.track(self, joints, previous)


def test_labels_that_are_not_invariant_are_found_with_the_remedy():
    robot = irs.Robot(ForgottenLabels(irs.make_robot("rrr3_base").mechanism.geometry))
    _, check = conformance(robot, joints=120, only=["branch goes on"])
    assert "the branch goes on in assembly mode" in check.broken
    assert "set label_is_invariant = False and write track" in check.broken
