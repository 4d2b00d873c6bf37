"""A mechanism of one's own, given as equations: where may it work, where does it lose control, which cells pair up.

Two cranks of different lengths about (0, 0) and (3, 0), two rods to one point P: six lengths, two motors.
"""

from irsbot_kinematics import algebra

mechanism = algebra.System(
    equations=[
        "(x - a*cos(q1))^2 + (y - a*sin(q1))^2 = c^2",
        "(x - d - b*cos(q2))^2 + (y - b*sin(q2))^2 = c^2",
    ],
    pose=["x", "y"],
    joints=["q1", "q2"],
    angles=["q1", "q2"],  # they occur as cos and sin; the circle of each is understood
    parameters={"a": 1, "b": "0.5", "c": 2, "d": 3},  # exact: the text 0.5 is 1/2
    name="two cranks",
)

for kind in ("parallel", "serial"):
    factors = [component[-1] for component in algebra.singularities(mechanism, kind)]
    print(kind, "singular where", "  or  ".join(f"{factor} = 0" for factor in factors))

type2 = algebra.project(mechanism, "parallel", space="pose")
print("Type 2 in the workspace: degrees", [p.degree for p in type2])

cells = algebra.decompose(mechanism, ("x", "y"), box=((-4, 6), (-4, 4)), cache=False)
for count, area in cells.areas().items():
    print(f"{count} inverse solutions on {area:.6f}")
here = cells.locate(("1.5", "1.6"))
assert here is not None
assert here.count == len(algebra.configurations(mechanism, {"x": "1.5", "y": "1.6"})) == 4

mechanism_longer = mechanism.assign(c="2.5")
postures = algebra.configurations(mechanism_longer, {"q1": 0.4, "q2": 1.9})
print("assembly modes at (0.4, 1.9):", [{name: round(v, 6) for name, v in p.pose.items()} for p in postures])
assert len(postures) == 2
