"""Tables 3 and 4 of [S4] beside ours: degree, partial degrees, terms, bits, and the times of Maple and of this library.

Maple's times are those of the paper and hold the drawing of the surface too; ours hold the polynomial and its factors.
"""

from time import perf_counter

from irsbot_kinematics import algebra

# As printed: plotting time (s), degrees, terms, bits. Corrections of docs/explanation/sources.md are marked with *.
PRINTED = {
    ("orthoglide", "parallel", "pose"): (7.650, "18[10,10,10]", 97, 15),
    ("hybridglide", "parallel", "pose"): (23.536, "20[16,8,12]", 119, 17),
    ("triaglide", "parallel", "pose"): (13.682, "3[0,0,3]", 2, 2),
    ("uranesx", "parallel", "pose"): (25.100, "6[6,4,0]", 15, 40),
    ("orthoglide", "parallel", "joint"): (0.850, "6[4,4,4]", 10, 4),
    ("hybridglide", "parallel", "joint"): (2.917, "6[4,4,4]", 25, 6),
    ("triaglide", "parallel", "joint"): (9.589, "6[4,4,4]", 41, 6),
    ("uranesx", "parallel", "joint"): (2.300, "6[4,4,4]", 41, 51),
    ("orthoglide", "serial", "pose"): (7.230, "6[4,4,4]", 17, 6),
    ("hybridglide", "serial", "pose"): (7.243, "6[6,2,4]", 15, 6),
    ("triaglide", "serial", "pose"): (5.437, "6[6,6,0]*", 10, 6),
    ("uranesx", "serial", "pose"): (10.700, "6[12,12,0]*", 13, 36),
    ("orthoglide", "serial", "joint"): (3.957, "18[12,12,12]", 62, 12),
    ("hybridglide", "serial", "joint"): (6.173, "18[12,12,12]", 281, 17),
    ("triaglide", "serial", "joint"): (6.794, "6[6,6,6]", 42, 7),
    ("uranesx", "serial", "joint"): (7.400, "12[12,12,12]", 252, 151),
}

systems = {name: algebra.predefined(name) for name in ("orthoglide", "hybridglide", "triaglide", "uranesx")}
print(
    f"{'robot':12}{'kind':10}{'space':7}{'printed':>15}{'ours':>15}{'terms':>12}{'bits':>10}{'Maple s':>9}{'ours s':>9}"
)
total = 0.0
for (name, kind, space), (seconds, degrees, terms, bits) in PRINTED.items():
    start = perf_counter()
    found = algebra.project(systems[name], kind, space)
    took = perf_counter() - start
    total += took
    ours = f"{found.degree}[{','.join(map(str, found.degrees))}]"
    print(
        f"{name:12}{kind:10}{space:7}{degrees:>15}{ours:>15}{f'{terms} {found.terms}':>12}"
        f"{f'{bits} {found.height_bits}':>10}{seconds:9.3f}{took:9.3f}"
    )
    assert found.terms == terms
    assert ours == degrees or degrees.endswith("*")
    assert found.height_bits == bits or name == "uranesx"  # the paper's rational sqrt 3 is not printed
print(f"all 16 in {total:.3f} s")
