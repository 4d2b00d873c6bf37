"use strict";
// The workspace of the live page. What stands still and the path are drawn once, on a picture beside the page; each frame
// adds what is new of the path, and the mechanism on top.

const PATH_MS = 1000;  // how long the path may be older than the plots
const Ground = { key: "", picture: null, drawn: -Infinity, until: 0, place: null, number: -1 };
const NO_VIEW = { task: [], joints: [], places: [], planar: true, links: [], rails: [], loci: [], note: "" };

// rows: [time, level, columns, pose, ...] with `least`, the smallest margin. number: another one for each setup.
function drawScene(canvas, rows, now, box, view, number) {
  const at = sized(canvas), { pen, width, height, em, ratio } = at, pose = rows.length ? rows[rows.length - 1][3] : [];
  const joints = Object.fromEntries(view.links.filter((link) => link.axis).map((link) => [link.joint, [now.joints[link.joint] ?? null]]));
  const data = { view, posture: { t: [0], joints, pose: view.task.map((_, k) => [pose[k]]) } };
  const moving = bars(data, 0).flatMap(([from, to]) => [flat(data, from), flat(data, to)]);
  for (const line of box) for (const corner of line) moving.push(flat(data, placed(view, corner)));
  const place = sight(data, rows, Ground.number === number ? moving : [...moving, ...lociPoints(data)]), most = above(rows.reduce((before, row) => Math.max(before, row.least), 0)) || 1;
  const key = [at.number, Theme.number, number, most, ...place.middle, ...place.size, ...View.turn].join();
  const whole = key !== Ground.key || performance.now() - Ground.drawn > PATH_MS;
  if (whole) {
    Ground.picture = beside(Ground.picture, at, width, height);
    drawGround(Ground.picture.getContext("2d"), data, place, width, height, em);
    Object.assign(Ground, { key, number, drawn: performance.now(), until: -Infinity });
  }
  let first = rows.length;
  while (first > 0 && rows[first - 1][0] > Ground.until) first -= 1;
  const path = rows.slice(Math.max(0, first - 1));  // from where it ended
  drawPath(Ground.picture.getContext("2d"), data, em, path.map((row, k) => (
    { at: placed(view, row[3]), share: row.least / most, apart: k > 0 && row[0] - path[k - 1][0] > APART_S })), false);
  Ground.until = now.t;
  pen.setTransform(1, 0, 0, 1, 0, 0);
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.drawImage(Ground.picture, 0, 0);
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  drawMarks(pen, data, em, rows.filter((row, k) => !k || row[1] !== rows[k - 1][1]).map((row) => [row[1], placed(view, row[3])]));
  drawPosture(pen, data, 0, em);
  drawBox(pen, data, box);
}

// What has to be seen only grows, or the picture would tremble; and by more than it must, or it would do so often.
function sight(data, rows, moving) {
  const before = Ground.place;
  if (before === null) {
    const path = rows.map((row) => placed(data.view, row[3])).filter(known).map((p) => flat(data, p));
    const all = [...lociPoints(data), ...path, ...moving];
    const found = around(all);
    if (all.length) Ground.place = found;
    return found;
  }
  const outside = (p) => [0, 1].some((i) => Math.abs(p[i] - before.middle[i]) > before.size[i] / 2 + 1e-9);
  if (!moving.some(outside)) return before;
  const corners = [-1, 1].map((way) => [0, 1].map((i) => before.middle[i] + way * before.size[i] / 2));
  const { middle, size } = around([...corners, ...moving]);
  Ground.place = { middle, size: size.map((one, i) => (one > before.size[i] ? 1.05 * one : one)) };
  return Ground.place;
}

function drawBox(pen, data, lines) {
  pen.strokeStyle = theme("focus");
  pen.lineWidth = 1.5;
  pen.setLineDash([]);
  for (const one of lines) {
    pen.beginPath();
    for (const corner of one) pen.lineTo(...View.to(flat(data, placed(data.view, corner))));
    pen.stroke();
  }
}

{
  const view = element("view");
  let turning = null;
  view.addEventListener("pointerdown", (event) => { turning = [event.clientX, event.clientY]; view.setPointerCapture(event.pointerId); });
  view.addEventListener("pointermove", (event) => {
    if (turning === null) return;
    View.turn = [View.turn[0] + (event.clientX - turning[0]) * 0.01, Math.min(1.5, Math.max(-1.5, View.turn[1] + (event.clientY - turning[1]) * 0.01))];
    turning = [event.clientX, event.clientY];
    Ground.place = null;
  });
  view.addEventListener("pointerup", () => { turning = null; });
}
