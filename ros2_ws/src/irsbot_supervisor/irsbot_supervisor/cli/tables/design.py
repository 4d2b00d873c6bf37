"""Output of `design` for people."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import degrees, inf
from typing import Any

from rich.table import Table

from irsbot_kinematics.design import ERRATA, QUESTIONS, ZONES, Cells, Move, SingularPosture, Verdict, reachability
from irsbot_kinematics.design.cells import Cell
from irsbot_kinematics.design.search import Found
from irsbot_kinematics.mechanism import Signs
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry
from irsbot_supervisor.cli.common import sign_text
from irsbot_supervisor.cli.tables.design_facts import MODES, zones_facts

_ZONE_TEXT = {
    "a": "Z_a: can be assembled",
    "wac": "Z_wac: no psi_I = psi_II + pi",
    "i": "Z_I: no Case I",
    "csc": "no Case I, II, III",
    "z": "Z: assembled, no Case I, II, III",
    "wps": "Z_wps: Z and Z_wac",
    "strict": "Z_wps_strict: free in all modes",
}
_HERE = "* this design"
_ZONE_ERRATA = {"a": ("assembled",), "wac": ("opposite",), "z": ("assembled",), "wps": ("assembled", "opposite")}


def asked_for(zone: str, mode: Signs | None, below: bool) -> str:
    """The question of a check in words."""
    if mode is None:
        return _ZONE_TEXT[zone]
    return f"working mode {sign_text(mode)}{', below the line through the motors' if below else ''}"


def verdict_tables(verdict: Verdict, nearest: tuple[Move, ...]) -> Iterator[Table]:
    yield _questions(verdict)
    yield _zones(verdict.zones, verdict.printed)
    flow = Table("step", "design flow (Fig. 16, step 5 ours)", "answer", "because")
    for step in verdict.flow:
        flow.add_row(str(step.number), step.question, _yes(step.answer), step.because)
    yield flow
    if verdict.met():
        yield _modes(verdict)
    yield _moves(verdict, nearest)


def _questions(verdict: Verdict) -> Table:
    table = Table("", "question", "answer", "why", "slack [mm]")
    for finding in verdict.findings:
        needed = finding.name in ZONES[verdict.zone]
        slack = "" if finding.larger == inf else f"{1e3 * (finding.larger - finding.smaller):.2f}"
        title = QUESTIONS[finding.name].title
        table.add_row("*" if needed else "", title, _yes(finding.holds), finding.why, slack)
    table.caption = f"* needed in zone '{verdict.zone}'; bc, h: `irsbot design zones`"
    return table


def _zones(exact: Mapping[str, bool], stated: Mapping[str, bool]) -> Table:
    table = Table("zone", "exact", "printed", "printed -> correct")
    for name, inside in exact.items():
        wrong = name in stated and stated[name] != inside
        notes = [f"{ERRATA[key].where}: {ERRATA[key].correct}" for key in _ZONE_ERRATA.get(name, ()) if wrong]
        table.add_row(_ZONE_TEXT[name], _yes(inside), _yes(stated[name]) if name in stated else "-", "; ".join(notes))
    return table


def _modes(verdict: Verdict) -> Table:
    table = Table("working mode", "below the motors", "above")
    for mode in MODES:
        cells = []
        for below in (True, False):
            met = [one.what for one in verdict.met() if one.below == below and _agree(one.working_mode, mode)]
            cells.append(", ".join(met) or "free")
        table.add_row(sign_text(mode), *cells)
    return table


def _moves(verdict: Verdict, nearest: tuple[Move, ...]) -> Table:
    table = Table("parameter", "now", "bound", "change", "that decides")
    for move in nearest:
        scale = degrees(1.0) if move.parameter == "beta" else 1.0
        unit = "deg" if move.parameter == "beta" else "m"
        table.add_row(
            move.parameter,
            f"{move.now * scale:.6g} {unit}",
            f"{move.then * scale:.6g} {unit}",
            f"{100.0 * move.relative:+.1f} %",
            QUESTIONS[move.question].title,
        )
    change = "leaves" if verdict.free else "enters"
    table.caption = f"nearest single change that {change} zone '{verdict.zone}'"
    if not nearest:
        table.caption = f"no single change {change} zone '{verdict.zone}'"
    return table


def cells_tables(found: Cells) -> Iterator[Table]:
    p = Table("cell of p", "from [m]", "to [m]", title=f"beta in {found.beta.name}", title_justify="left")
    for cell in found.p:
        p.add_row(*_cell(cell))
    p.caption = _HERE
    yield p
    kinds = list(found.counts)
    table = Table("cell of l2eq", "from [m]", "to [m]", *kinds, "Table 3")
    table.columns[0].no_wrap = True
    for row in found.l2eq:
        table.add_row(*_cell(row), *[str(row.counts[kind]) for kind in kinds], _yes(row.table_3))
    table.caption = f"{_HERE}; postures of Cases I to III (Table 1) and Condition 1; Table 3: free of Cases I to III"
    yield table
    errata = Table("in [S0]", "printed", "correct")
    for key in ("p4", "p6", "l2eq3", "l2eq4", "case_2", "condition_1"):
        errata.add_row(*ERRATA[key])
    yield errata


def _cell(cell: Cell) -> tuple[str, str, str]:
    return f"{cell.name}{' *' if cell.here else ''}", f"{cell.low.value:.5f}", f"{cell.high.value:.5f}"


def zones_tables(g: Irsbot2Geometry) -> Iterator[Table]:
    facts = zones_facts(g)
    bounds = Table("condition", "in the {l1, b} plane [m]")
    for name, text in facts["bounds"].items():
        bounds.add_row(QUESTIONS[name].title, text)
    yield bounds
    exact = {name: entry["exact"] for name, entry in facts["zones"].items()}
    stated = {name: entry["printed"] for name, entry in facts["zones"].items() if entry["printed"] is not None}
    yield _zones(exact, stated)


def postures_table(g: Irsbot2Geometry, found: tuple[SingularPosture, ...]) -> Table:
    table = Table("kind", "psi [deg]", "theta [deg]", "lambda [m]", "gains", "held at (x, z) [m], working mode")
    for posture in found:
        where = reachability(g, posture)
        held = [f"({_z(p.pose[0])}, {_z(p.pose[1])}) {sign_text(p.working_mode)}" for p in where.placements]
        if where.anywhere:
            held = ["every q_I = q_II"]
        table.add_row(
            posture.kind.value,
            *[", ".join(f"{degrees(angle):.3f}" for angle in pair) for pair in (posture.psi, posture.theta)],
            ", ".join(f"{length:.6f}" for length in posture.lam),
            posture.gained + (", Type 2" if posture.is_type_2 else ""),
            "\n".join(held) or f"out of reach by {1e3 * where.slack:.2f} mm",
        )
    return table


def sweep_table(summary: Mapping[str, Any]) -> Table:
    table = Table("", "designs", title=f"written: {summary['output']}", title_justify="left")
    for name, value in summary.items():
        if name != "output":
            table.add_row(_ZONE_TEXT.get(name.removeprefix("zone_"), name.replace("_", " ")), f"{value}")
    return table


def found_table(rows: Mapping[str, Found]) -> Table:
    table = Table("", *rows)
    for name in ("l1", "l2eq", "b", "p", "a1", "a2", "e"):
        table.add_row(f"{name} [m]", *[f"{getattr(found.geometry, name):.4f}" for found in rows.values()])
    table.add_row("beta [deg]", *[f"{degrees(found.geometry.beta):.2f}" for found in rows.values()])
    boxes = [found.rectangle for found in rows.values()]
    table.add_row("useful |x| up to [m]", *[f"{box.half_width:.4f}" for box in boxes])
    table.add_row("useful z [m]", *[f"{box.z_low:.4f} .. {box.z_high:.4f}" for box in boxes])
    table.add_row("useful area [m2]", *[f"{box.area:.4f}" for box in boxes])
    table.add_row("slack [mm]", *[f"{1e3 * found.slack:.1f}" for found in rows.values()])
    return table


def _agree(met: Signs, mode: Signs) -> bool:
    return all(sign in (0, wanted) for sign, wanted in zip(met, mode, strict=True))


def _z(value: float) -> str:
    """Four digits, without the sign of a rounded zero."""
    return f"{round(value, 4) + 0.0:.4f}"


def _yes(answer: bool) -> str:
    return "yes" if answer else "no"
