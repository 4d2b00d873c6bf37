"use strict";
// The workspace: loci, the path coloured by its margin, verdict changes, and the mechanism at the cursor.

const View = { turn: [-0.6, 0.5], fit: "all", path: null };
const RAMP = ["#b2182b", "#e08214", "#e6c229", "#5aae61", "#2166ac"];  // small to large margins; its lightness tells, too
const SHADES = 48;
const SHAPES = { OK: "circle", WARN: "triangle", STOP: "square", UNKNOWN: "diamond" };

function ramp(share) {
  const at = Math.min(0.9999, Math.max(0, share)) * (RAMP.length - 1), k = Math.floor(at);
  const parts = [1, 3, 5].map((i) => {
    const [a, b] = [RAMP[k], RAMP[k + 1]].map((colour) => parseInt(colour.slice(i, i + 2), 16));
    return Math.round(a + (b - a) * (at - k));
  });
  return `rgb(${parts})`;
}

const SHADE = Array.from({ length: SHADES }, (_, k) => ramp((k + 0.5) / SHADES));

const plus = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const times = (m, v) => [0, 1, 2].map((i) => m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2]);
const product = (a, b) => a.map((row) => [0, 1, 2].map((j) => row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j]));

// Rotation about a unit axis, formula of Rodrigues.
function rotation([x, y, z], angle) {
  const c = Math.cos(angle), s = Math.sin(angle), k = 1 - c;
  return [[c + x * x * k, x * y * k - z * s, x * z * k + y * s], [y * x * k + z * s, c + y * y * k, y * z * k - x * s],
    [z * x * k - y * s, z * y * k + x * s, c + z * z * k]];
}

// Bars of the mechanism at a row of the postures: [from, to, name of the link]; none where the pose is not known.
function bars(data, row) {
  const { links, rails } = data.view, joints = data.posture.joints;
  const frames = { base: { turn: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], at: [0, 0, 0] } };
  const found = rails.map(([from, to]) => [from, to, "base"]);
  for (const link of links) {
    const parent = frames[link.parent], q = link.axis ? joints[link.joint][row] : 0;
    if (q === null) return rails.map(([from, to]) => [from, to, "base"]);
    let { turn } = parent, at = plus(parent.at, times(turn, link.origin));
    if (link.axis && link.slides) at = plus(at, times(turn, link.axis.map((part) => part * q)));
    else if (link.axis) turn = product(turn, rotation(link.axis, q));
    frames[link.name] = { turn, at };
    for (const end of link.shape) found.push([at, plus(at, times(turn, end)), link.name]);
    if (link.slides) found.push([plus(parent.at, times(parent.turn, link.origin)), at, "base"]);
  }
  return found;
}

// The platform point at a row, in the base frame; null where it is not known.
function point(data, row) {
  return placed(data.view, data.posture.pose.map((column) => column[row]));
}

function placed(view, pose) {
  const at = [0, 0, 0];
  for (let k = 0; k < view.places.length; k++) {
    if (pose[k] === null || pose[k] === undefined) return null;
    at[view.places[k]] = pose[k];
  }
  return at;
}

// From the base frame to the plane of the picture, m: the plane of motion, or a view from the side that can be turned.
function flat(data, p) {
  if (data.view.planar) return [p[data.view.places[0]], p[data.view.places[1]]];
  const [a, b] = View.turn, x = Math.cos(a) * p[0] - Math.sin(a) * p[1], y = Math.sin(a) * p[0] + Math.cos(a) * p[1];
  return [x, Math.cos(b) * p[2] + Math.sin(b) * y];
}

// A point of a locus on the plane of the picture: loci of robots in space are a section of theirs.
const onPicture = (data, p) => (data.view.planar || p[0] === null ? p : flat(data, p));
const lociPoints = (data) => data.view.loci.flatMap((locus) => locus.points).filter((p) => p[0] !== null).map((p) => onPicture(data, p));

// Entries of the legend: [kind of line, colour, text].
function lociEntries({ loci, section }) {
  const kinds = new Set(loci.map((locus) => locus.kind)), at = section ? `, section at ${section}` : "", found = [];
  if (kinds.has("type1")) found.push(["solid", "soft", `Type 1 locus, boundary${at}`]);
  if (kinds.has("type2")) found.push(["dashed", "stop-ink", `Type 2 locus${at}`]);
  return found;
}

function extent(data) {
  const points = [];
  for (let row = 0; row < data.posture.t.length; row += 1 + Math.floor(data.posture.t.length / 400)) {
    const p = point(data, row);
    if (p) points.push(flat(data, p));
  }
  if (View.fit === "all" || !points.length) {
    points.push(...lociPoints(data));
    const rows = data.posture.t.length;
    for (const row of [0, rows >> 1, rows - 1]) {
      for (const [from, to] of bars(data, row)) points.push(flat(data, from), flat(data, to));
    }
  }
  return around(points);
}

// What has to be seen of points of the picture: its middle and its size.
function around(points) {
  if (!points.length) return { middle: [0, 0], size: [1, 1] };
  const low = [0, 1].map((i) => points.reduce((least, p) => Math.min(least, p[i]), Infinity));
  const high = [0, 1].map((i) => points.reduce((most, p) => Math.max(most, p[i]), -Infinity));
  const floor = 1e-3 + 0.02 * Math.max(high[0] - low[0], high[1] - low[1]);
  return { middle: [0, 1].map((i) => 0.5 * (low[i] + high[i])), size: [0, 1].map((i) => Math.max(high[i] - low[i], floor)) };
}

// Everything that stands still goes to a picture of its own, so that the cursor moves without redrawing it.
// place: what has to be seen.
function prepareView(canvas, data, place = extent(data)) {
  const { pen, width, height, em } = sheet(canvas), { posture } = data;
  drawGround(pen, data, place, width, height, em);
  const most = Math.max(...maximum(posture.margin)), breaks = new Set(posture.breaks);
  drawPath(pen, data, em, posture.t.map((_, row) => ({ at: point(data, row), share: posture.margin[row] / most, apart: breaks.has(row) })), posture.thinned);
  drawMarks(pen, data, em, data.chapters.map((one) => [one.level, point(data, rowAt(posture.t, one.time_s))]));
  View.path = document.createElement("canvas");
  View.path.width = canvas.width;
  View.path.height = canvas.height;
  View.path.getContext("2d").drawImage(canvas, 0, 0);
}

// Axes and loci.
function drawGround(pen, data, { middle, size }, width, height, em) {
  const pad = 2.6 * em, scale = Math.min((width - 2 * pad) / size[0], (height - 2 * pad) / size[1]);
  const to = (p) => [width / 2 + (p[0] - middle[0]) * scale, height / 2 - (p[1] - middle[1]) * scale];
  View.to = to;
  if (data.view.planar) axes(pen, em, width, height, middle, scale, to); else triad(pen, em, data, height);
  for (const locus of data.view.loci) {
    pen.strokeStyle = locus.kind === "type1" ? theme("soft") : theme("stop-ink");
    pen.lineWidth = 1.6;
    pen.setLineDash(locus.kind === "type1" ? [] : [6, 3]);
    curve(pen, locus.points.map((p) => onPicture(data, p)), to);
  }
  pen.setLineDash([]);
}

// The path, coloured by the margin. rows: place in the base frame or null, share of the largest margin, and whether
// nothing is known before it. dots: without lines between them, which would be chords that nobody took.
function drawPath(pen, data, em, rows, dots) {
  const dot = 0.18 * em;
  pen.lineCap = pen.lineJoin = "round";
  pen.lineWidth = 0.22 * em;
  let before = null, shade = null;
  const end = () => { if (shade !== null) pen.stroke(); shade = null; };
  for (const { at, share, apart } of rows) {
    const here = at && View.to(flat(data, at)), next = Math.min(SHADES - 1, Math.floor(SHADES * share));
    if (!here || dots || apart || next !== shade) end();
    if (here && dots) {
      pen.fillStyle = SHADE[next];
      pen.fillRect(here[0] - dot / 2, here[1] - dot / 2, dot, dot);
    } else if (here) {
      if (shade === null) {  // a stretch of one colour is one line
        pen.strokeStyle = SHADE[next];
        pen.beginPath();
        pen.moveTo(...(before && !apart ? before : [here[0] - 0.5, here[1]]));
        shade = next;
      }
      pen.lineTo(...here);
    }
    before = here;
  }
  end();
}

// Changes of the level. found: [level, place in the base frame or null], in order.
function drawMarks(pen, data, em, found) {
  found.forEach(([level, at], k) => {
    if (at && (!k || level !== found[k - 1][0])) mark(pen, View.to(flat(data, at)), level, 0.42 * em);
  });
}

function* maximum(values) {
  yield 1e-9;
  let most = 0;
  for (const value of values) if (value !== null && value > most) most = value;
  yield most;
}

function axes(pen, em, width, height, middle, scale, to) {
  pen.strokeStyle = theme("grid");
  pen.fillStyle = theme("soft");
  const wide = ticks(middle[0] - width / 2 / scale, middle[0] + width / 2 / scale, width / (6 * em));
  for (const value of wide.found) {
    const [x] = to([value, 0]);
    line(pen, x, 0, x, height - 1.3 * em);
    pen.fillText(value.toFixed(wide.digits), x + 2, height - 0.3 * em);
  }
  const tall = ticks(middle[1] - height / 2 / scale, middle[1] + height / 2 / scale, height / (4 * em));
  for (const value of tall.found) {
    const [, y] = to([0, value]);
    line(pen, 0, y, width, y);
    pen.fillText(value.toFixed(tall.digits), 2, y - 2);
  }
}

// Which way the axes of the base point.
function triad(pen, em, data, height) {
  pen.strokeStyle = pen.fillStyle = theme("soft");
  pen.lineWidth = 1;
  [[1, 0, 0], [0, 1, 0], [0, 0, 1]].forEach((axis, k) => {
    const [x, y] = flat(data, axis), at = [2.4 * em, height - 2.4 * em];
    line(pen, ...at, at[0] + 1.5 * em * x, at[1] - 1.5 * em * y);
    pen.fillText("xyz"[k], at[0] + 1.9 * em * x - 0.2 * em, at[1] - 1.9 * em * y + 0.2 * em);
  });
}

function curve(pen, points, to) {
  pen.beginPath();
  let open = false;
  for (const p of points) {
    if (p[0] === null || p[1] === null) { open = false; continue; }
    if (open) pen.lineTo(...to(p)); else pen.moveTo(...to(p));
    open = true;
  }
  pen.stroke();
}

function mark(pen, [x, y], level, r) {
  pen.fillStyle = theme(level.toLowerCase());
  pen.strokeStyle = theme(level.toLowerCase() + "-ink");
  pen.lineWidth = 1.8;
  pen.beginPath();
  const shape = SHAPES[level];
  if (shape === "circle") pen.arc(x, y, r, 0, 7);
  else {
    const corners = { triangle: [-90, 30, 150], square: [45, 135, 225, 315], diamond: [0, 90, 180, 270] }[shape];
    corners.forEach((turn) => pen.lineTo(x + 1.25 * r * Math.cos(turn * Math.PI / 180), y + 1.25 * r * Math.sin(turn * Math.PI / 180)));
    pen.closePath();
  }
  pen.fill();
  pen.stroke();
}

function drawView(canvas, data, cursor) {
  const pen = canvas.getContext("2d"), ratio = window.devicePixelRatio || 1, row = rowAt(data.posture.t, cursor);
  const em = parseFloat(getComputedStyle(canvas).fontSize);
  pen.setTransform(1, 0, 0, 1, 0, 0);
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.drawImage(View.path, 0, 0);
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  drawPosture(pen, data, row, em);
}

// The mechanism at a row, and a ring around its platform.
function drawPosture(pen, data, row, em) {
  pen.lineCap = "round";
  pen.setLineDash([]);
  for (const [from, to, name] of bars(data, row)) {
    pen.strokeStyle = theme(name === "base" ? "base" : name === "platform" ? "l1" : "rod");
    pen.lineWidth = (name === "base" ? 2 : name === "platform" ? 4 : 3) * em / 16;
    line(pen, ...View.to(flat(data, from)), ...View.to(flat(data, to)));
    if (name !== "base") {
      const [x, y] = View.to(flat(data, from));
      pen.fillStyle = theme("card");
      pen.lineWidth = 1.5;
      pen.beginPath();
      pen.arc(x, y, 0.19 * em, 0, 7);
      pen.fill();
      pen.stroke();
    }
  }
  const p = point(data, row);
  if (!p) return;
  pen.strokeStyle = theme("focus");
  pen.lineWidth = 2;
  pen.beginPath();
  pen.arc(...View.to(flat(data, p)), 0.45 * em, 0, 7);
  pen.stroke();
}
