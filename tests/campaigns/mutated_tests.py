"""Which tests belong to which module, the cheapest first: mutations.py runs them in this order."""

from __future__ import annotations

KINEMATICS = "irsbot_kinematics/test/test_{}.py"
SUPERVISOR = "irsbot_supervisor/test/test_{}.py"

EVERY_ROBOT = (
    "symmetry",
    "laws",
    "robot",
    "boxes",
    "displacement",
    "precision",
    "force_workspace",
    "geometry_errors",
    "urdf",
    "conformance",
)
"""Tests that take each shipped robot in turn."""

DELTAS = ("hybridglide", "linear_delta", "orthoglide", "triaglide", "uranesx")
PLANAR = ("five_bar", "irsbot2", "irsbot2_beta45")
SLIDING = ("rails2", "rails3", "rpr3")
CRANKS = ("rrr3_base", "ruu4")

ROBOTS: dict[str, tuple[str, ...]] = {
    "branched_platform": SLIDING + CRANKS,
    "crank_platform": CRANKS,
    "delta_family": DELTAS,
    "delta_kinematics": DELTAS,
    "planar_columns": PLANAR,
    "planar_kinematics": PLANAR,
    "planar_loop": PLANAR,
    "planar_pair": PLANAR,
    "sliding_platform": SLIDING,
    "turning_platform": ("rrr3", *SLIDING, *CRANKS),
    "rod_platform": ("rrr3", "ruu4"),
    "irsbot2_space": ("irsbot2", "irsbot2_csc"),
    "irsbot2": PLANAR,
    "geometry_checks": (),
}
"""Mechanism -> robots that it is shown with, if not with the one of its own name."""

DESIGNS = ("design_check", "design_sweep", "design_distal", "design_proximal")

OWN: dict[str, tuple[str, ...]] = {
    "five_bar": ("planar_bounds",),
    "branched_platform": ("crank_platforms", "crank_branches", "rod_platform"),
    "crank_platform": ("crank_platforms", "crank_bounds", "crank_branches"),
    "delta_family": ("delta_bounds", "delta_family"),
    "delta_kinematics": ("delta_edges", "delta_family"),
    "geometry_checks": ("geometry",),
    "irsbot2": ("irsbot2", "planar_bounds", "irsbot2_space", "planar_indices"),
    "irsbot2_space": ("irsbot2_space", "bounds_of_many", *DESIGNS),
    "planar_columns": ("bounds_of_many",),
    "planar_kinematics": ("irsbot2", "planar_bounds", "planar_indices"),
    "planar_loop": ("irsbot2", "planar_bounds", "planar_indices", "workspace_maps"),
    "planar_pair": ("irsbot2", "planar_bounds", "planar_indices", "bounds_of_many"),
    "rod_platform": ("rod_platform",),
    "rrr3": ("rrr3", "rrr3_bounds", "sliding_platform"),
    "rrr3_base": ("crank_platforms", "crank_bounds", "crank_branches"),
    "ruu4": ("crank_platforms", "crank_bounds", "crank_branches", "ruu4_limbs"),
    "sliding_platform": ("sliding_platform",),
    "turning_platform": ("rrr3_bounds", "sliding_platform"),
}
"""Mechanism -> tests of it alone."""

ALL_KINDS = ("five_bar", "orthoglide", "rrr3", "rpr3", "ruu4")
"""A robot of each kind; rrr3 names rrr3_base, too."""

BOUNDS: dict[str, tuple[str, ...]] = {
    "displacement": ("displacement_inequalities", "bounds_derived", "displacement", "geometry_errors"),
    "box_code": ("box_code",),
    "boxes": ("box_rods", "boxes", "geometry_errors"),
    "couples": ("box_code", "box_rods", "crank_bounds"),
    "cranks": ("box_code", "box_rods", "crank_bounds"),
    "quadratics": ("quadratics", "box_rods", "boxes"),
    "cubics": ("cubics", "box_rods", "boxes"),
    "sizes": ("bounds_derived", "box_rods", "bounds_of_many", "boxes"),
    "type2_over_box": ("type2_over_box", "box_rods", "boxes", "geometry_errors"),
    "columns": ("bounds_of_many",),
}

SUPERVISORS = ("supervisor", "supervisor_samples", "supervisor_late", "supervisor_branch", "supervisor_stops")
BYPASSES = ("bypass", "bypass_record")
ESTIMATORS = ("estimator_numbers", "estimator", "estimator_faults", "estimator_silence")

CORE: dict[str, tuple[str, ...]] = {
    "assessment": ("estimator", "branches", *SUPERVISORS, "quiet_stretches"),
    "box_search": ("stopping", "velocity_gate"),
    "bypass": (*BYPASSES, *SUPERVISORS),
    "escape": ("escape", *SUPERVISORS, "velocity_gate"),
    "latch": ("latch_record", "latch", *SUPERVISORS),
    "margins": ("escape", "policy", "settings", *SUPERVISORS, "stopping"),
    "policy": ("policy", *SUPERVISORS),
    "position_limits": ("position_limits", *SUPERVISORS),
    "reachable_box": ("reachable_box", "stopping"),
    "report": (*SUPERVISORS, "diagnostics"),
    "speaker": (*SUPERVISORS, *BYPASSES),
    "seed_pose": ("branches", "supervisor_stops"),
    "settings": ("settings_values", "settings", "feasibility", "proposal"),
    "stop_monitor": ("stop_monitor", *SUPERVISORS),
    "stopping": ("stopping", "position_limits", "quiet_boxes", "velocity_gate"),
    "summary": ("summary",),
    "view": ("velocity_gate",),
    "supervisor": (*SUPERVISORS, *BYPASSES, "branches", "sim_faults"),
    "validation": ("validation", *ESTIMATORS, *SUPERVISORS),
    "observer": ("observer", *ESTIMATORS, "velocity_gate"),
    "sample_interval": ("sample_interval", *ESTIMATORS, "supervisor_late", "supervisor_samples"),
}
ESTIMATION = (*ESTIMATORS, "validation", "samples", *SUPERVISORS)


def tests_of(module: str) -> tuple[list[str], str]:
    """Test files below ros2_ws/src and the keyword for pytest, empty for all of them."""
    package, folder, *inner = module.removesuffix(".py").split("/")
    name = inner[0] if folder == "mechanisms" else inner[-1]
    if package == "irsbot_supervisor":
        return [SUPERVISOR.format(test) for test in CORE.get(name, ESTIMATION)], ""
    if folder == "bounds":
        own = (
            "displacement",
            "box_code",
            "box_rods",
            "crank_bounds",
            "quadratics",
            "bounds_of_many",
            "bounds_derived",
            "type2_over_box",
        )
        return [KINEMATICS.format(test) for test in BOUNDS[name]], " or ".join(
            [*ALL_KINDS, *(f"test_{test}" for test in own)]
        )
    alone = dict.fromkeys((*OWN.get(name, ()), "geometry"))
    keyword = " or ".join([*ROBOTS.get(name, (name,)), *(f"test_{test}.py" for test in alone)])
    return [KINEMATICS.format(test) for test in dict.fromkeys((*alone, *EVERY_ROBOT))], keyword
