"""Draws docs/pictures/data_path.svg: a JointState on its way from the wire to the verdict.

./irsbot python docs/pictures/draw_data_path.py
"""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import escape

CORE = "irsbot_supervisor/core"
NODES = "irsbot_supervisor/nodes"
TARGET = Path(__file__).parent / "data_path.svg"

STAGES = (
    # kind, title, module, what it does, what it hands on
    ("ros", "JointState on the wire", "", "sensor_msgs/JointState, CDR bytes", "bytes"),
    ("ros", "receive", f"{NODES}/samples.py", "decodes; in a flood only the newest", "JointSample"),
    ("core", "validate", f"{CORE}/validation.py", "names, numbers, stamps against both clocks", "Accepted"),
    ("core", "estimate", f"{CORE}/estimation/estimator.py", "bounds of joint speeds", "Estimate"),
    ("core", "assess", f"{CORE}/assessment.py", "pose, margins, branch at this posture", "Assessment"),
    ("core", "predict stopping", f"{CORE}/stopping.py", "margins over the reachable box", "certified Margins"),
    ("core", "compare", f"{CORE}/policy.py", "the only place that compares with limits", "Findings"),
    ("core", "latch", f"{CORE}/latch.py", "the worst finding wins; dwell, latch, bypass", "Judgement"),
    ("core", "report", f"{CORE}/report.py", "records for the wire", "SingularityState, Verdict"),
    ("ros", "publish", f"{NODES}/supervisor.py", "supervisor/state, /verdict, /safe", ""),
)
SIDE = (
    # number of the stage it is drawn beside, direction of its arrow, module, text
    (1, "in", "irsbot_msgs_py/cdr.py", "message <-> record"),
    (2, "in", f"{CORE}/supervisor.py", "one door for samples, ticks, resets, bypasses, settings"),
    (2, "out", "", "Rejected: UNKNOWN, without the stages between"),
    (4, "in", "irsbot_kinematics/robot.py", "direct kinematics, Jacobians, margins"),
    (5, "in", "irsbot_kinematics/bounds/displacement.py", "bounds of the margins over boxes"),
    (6, "in", f"{CORE}/settings.py", "limits and times, checked before they get here"),
)
FILL = {"ros": "#fde3c8", "core": "#d6e6f5", "side": "#f2f2f2"}
WIDE, HIGH, STEP, LEFT, TOP = 390, 50, 76, 20, 54
"""Boxes of the way: size, distance, place of the first."""


def box(x: float, y: float, wide: float, kind: str, lines: tuple[str, ...]) -> str:
    """A box with a bold first line."""
    rows = [line for line in lines if line]
    looks = ['font-size="13" font-weight="bold"', *['font-size="11"'] * (len(rows) - 1)]
    text = "".join(
        f'<text x="{x + 10}" y="{y + 16 + 14 * number}" {look}>{escape(line)}</text>'
        for number, (line, look) in enumerate(zip(rows, looks, strict=True))
    )
    return f'<rect x="{x}" y="{y}" width="{wide}" height="{HIGH}" rx="5" fill="{FILL[kind]}" stroke="#555"/>{text}'


def label(x: float, y: float, text: str) -> str:
    """Text beside an arrow or a colour."""
    return f'<text x="{x}" y="{y}" font-size="12" font-style="italic">{escape(text)}</text>'


def arrow(x1: float, y1: float, x2: float, y2: float) -> str:
    """An arrow."""
    return f'<path d="M{x1} {y1} L{x2} {y2}" stroke="#333" stroke-width="1.5" marker-end="url(#tip)" fill="none"/>'


def way() -> list[str]:
    """The stages, one below the other, and what each hands on."""
    parts = []
    for number, (kind, title, module, does, hands) in enumerate(STAGES):
        y, middle = TOP + STEP * number, LEFT + WIDE / 2
        parts.append(box(LEFT, y, WIDE, kind, (f"{number}  {title}", module, does)))
        if hands:
            parts += [arrow(middle, y + HIGH, middle, y + STEP - 2), label(middle + 10, y + HIGH + 18, hands)]
    return parts


def beside(x: float) -> list[str]:
    """What the stages use, and where rejected samples go."""
    parts, taken = [], {number: 0 for number, *_rest in SIDE}
    for number, direction, module, text in SIDE:
        stage = LEFT + WIDE + 2, TOP + STEP * number + HIGH / 2
        y = TOP + STEP * (number + taken[number])
        taken[number] += 1
        parts.append(box(x, y, WIDE + 20, "side", (module or "rejected samples", text)))
        ends = ((x, y + HIGH / 2), stage) if direction == "in" else (stage, (x - 2, y + HIGH / 2))
        parts.append(arrow(*ends[0], *ends[1]))
    return parts


def drawing() -> str:
    """The picture as SVG."""
    far = LEFT + WIDE + 60
    wide, high = far + WIDE + 40, TOP + STEP * len(STAGES)
    legend = [
        f'<rect x="{x}" y="14" width="16" height="16" fill="{FILL[kind]}" stroke="#555"/>{label(x + 22, 27, text)}'
        for x, kind, text in (
            (LEFT, "ros", "node: ROS, clocks"),
            (LEFT + 170, "core", "core: pure, time is an argument"),
        )
    ]
    tip = (
        '<defs><marker id="tip" markerWidth="9" markerHeight="9" refX="7" refY="4" orient="auto">'
        '<path d="M0 0 L8 4 L0 8 z" fill="#333"/></marker></defs>'
    )
    size = f'viewBox="0 0 {wide} {high}" font-family="sans-serif" fill="#111"'
    parts = "\n".join([tip, f'<rect width="{wide}" height="{high}" fill="white"/>', *legend, *way(), *beside(far)])
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>\n{parts}\n</svg>\n'


if __name__ == "__main__":
    TARGET.write_text(drawing(), encoding="utf-8")
