"""Where a 3-RRR carries a load of 100 N in any direction and 5 N m, if no leg may carry more than 200 N."""

import math

import irsbot_kinematics as irs
from irsbot_kinematics.analysis.force_workspace import Load, admissible, force_workspace, pressure, reaction_map
from irsbot_kinematics.numerics.arithmetic import FLOATS

robot = irs.make_robot("rrr3")
mechanism, mode = robot.mechanism, robot.mechanism.usual_working_mode
load, centre = Load(force_n=100.0, moment_nm=5.0, admissible_n=200.0), (0.0, 0.0, math.radians(45.0))

boundary = force_workspace(mechanism, centre, mode, load, rays=360)  # polar: angle_rad, radius_m
print("it is carried on", round(boundary.area_m2, 4), "m2; to the right up to", round(boundary.radius_m[0], 6), "m")

largest = reaction_map(mechanism, centre, mode, load, first_m=(-0.1, 0.0, 0.1), second_m=(0.0, 0.05))  # (2, 3, 3) N
print("worst leg forces at the centre [N]:", largest[0, 1].round(4))

pose = (0.1, 0.05, math.radians(45.0))
for leg in pressure(mechanism.legs(FLOATS, robot.inverse(pose).tolist(), pose)):  # one entry per leg
    print("pressure angle [rad]", round(leg.angle_rad, 4), "instantaneous centre from P [m]", leg.centre_m)
    print("its distance d [m]", round(leg.distance_m, 4), "and R_max [N]", round(leg.reaction_max(100.0, 5.0), 4))

# The force workspace of the 2011 paper on near-singular configurations, as computed once more by hand.
assert math.isclose(boundary.radius_m[0], 0.205773, abs_tol=1e-6)
assert math.isclose(boundary.area_m2, 0.16875, rel_tol=2e-3)
assert math.isclose(largest[0, 1, 0], 86.0684, abs_tol=1e-4)
assert admissible(mechanism, [pose], mode, load)[0]
