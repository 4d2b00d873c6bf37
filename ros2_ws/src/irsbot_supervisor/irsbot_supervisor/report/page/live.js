"use strict";
// The live page. It asks for each frame, so what it shows was true after it had asked; a frame that it had to wait for,
// or that grew old on the screen, is shown as NOT CONNECTED and never as a level.

const SPAN_S = 30, OLD_MS = 500, RETRY_MS = 1000, WATCH_MS = 100;
const Live = { socket: null, askedAt: -Infinity, frameAt: -Infinity, now: null, setup: {}, rows: [], changes: [], place: null, drawing: null };
const element = (id) => document.getElementById(id);
const known = (value) => value !== null && value !== undefined;

function connect() {
  const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
  Live.socket = socket;
  socket.onopen = () => { Live.rows = []; Live.setup = {}; Live.changes = []; Live.place = null; ask(); };
  socket.onmessage = (event) => hear(JSON.parse(event.data));
  socket.onclose = () => { Live.socket = null; Live.frameAt = -Infinity; Live.now = null; lose(); setTimeout(connect, RETRY_MS); };
}

function ask() {
  if (Live.socket === null || Live.socket.readyState !== WebSocket.OPEN) return;
  Live.askedAt = performance.now();
  Live.socket.send("");
}

function hear({ setup, changes, rows, now }) {
  Live.frameAt = Live.askedAt;
  if (setup) { Live.setup = setup; Live.place = null; }
  if (changes) Live.changes = changes;
  Live.rows.push(...rows);
  while (Live.rows.length && now.t - Live.rows[0][0] > SPAN_S) Live.rows.shift();
  Live.now = now;
  const hidden = document.hidden;  // a page that nobody sees asks for nothing
  if (!hidden) ask();
  cancelAnimationFrame(Live.drawing);
  Live.drawing = requestAnimationFrame(() => { show(); if (hidden) ask(); });
}

// Whether what is shown was true a moment ago.
const present = () => Live.now !== null && performance.now() - Live.frameAt <= OLD_MS;

function lose() {
  document.body.className = "lost";
  document.title = "irsbot: not connected";
  element("level").className = "UNKNOWN";
  element("word").textContent = "NOT CONNECTED";
  element("why").textContent = Live.socket && Live.socket.readyState === WebSocket.OPEN ?
    "The page has heard nothing for a while: nothing is known of the robot." : "Nothing is known of the robot. The page tries again every second.";
}

function show() {
  if (!present()) { lose(); return; }
  const { now, setup } = Live, data = table();
  document.body.className = "";
  document.title = `${now.level} ${setup.robot || "irsbot"}`;
  element("level").className = now.level;
  element("word").textContent = now.level;
  element("why").textContent = why(now);
  element("tiles").replaceChildren(...tiles(now, setup));
  drawStrip(element("strip"), data, [-SPAN_S, 0]);
  drawTrack(element("margins"), data.tracks[0], data, [-SPAN_S, 0], true);
  legend(data.tracks[0]);
  element("changes").replaceChildren(...[...Live.changes].reverse().map((one) => row(now.t - one.t, one)));
  element("ages").textContent = ages(now);
  scene(data, now);
}

function why(now) {
  const { verdict } = now;
  if (verdict === null) return "No verdict was ever heard: a consumer brakes.";
  const parts = !now.silent ? [] : [`The last verdict, ${verdict.level}, is ${now.verdict_age_s.toFixed(2)} s old: a consumer brakes.`];
  if (verdict.latched) parts.push(`Stop ${verdict.event} is latched.`);
  parts.push(`Speed up to ${(100 * (now.silent ? 0 : verdict.speed_scale)).toFixed(0)} %.`);
  parts.push(...(verdict.findings.length ? verdict.findings : [verdict.text]).filter(Boolean));
  return parts.join(" ");
}

// One tile for each margin that is known, coloured by the limit it has crossed.
function tiles(now, setup) {
  const values = newest(2), found = [];
  (setup.columns || []).forEach((name, k) => {
    if (!known(values[k])) return;
    const of = (kind) => { const limit = (setup.limits || []).find((one) => one.of === name && one.kind === kind); return limit && limit.value; };
    const last = k === setup.columns.length - 1, stop = last ? now.stop_limit : of("stop"), warn = of("warn");
    const level = known(stop) && !(values[k] >= stop) ? "STOP" : known(warn) && !(values[k] >= warn) ? "WARN" : "OK";
    const limits = `stop below ${known(stop) ? stop : "–"}` + (known(warn) ? `, warning below ${warn}` : "");
    found.push(tile(name, values[k].toFixed(4), limits, level));
  });
  if (!found.length) found.push(tile("Margins", "not known", "no posture is known at present", "UNKNOWN"));
  const left = now.time_to_stop;
  found.push(tile("Braking begins", known(left) ? `in ${left.toFixed(3)} s` : "not foreseen", "on the present course, at the latest", ""));
  return found;
}

function tile(title, value, text, level) {
  const found = document.createElement("div"), [head, figure, foot] = ["small", "b", "small"].map((tag) => document.createElement(tag));
  found.className = `tile ${level}`;
  [head.textContent, figure.textContent, foot.textContent] = [title, value, text];
  found.append(head, figure, foot);
  return found;
}

function row(ago_s, one) {
  const found = document.createElement("tr");
  found.className = one.level;
  for (const text of [ago_s.toFixed(1), one.level, one.causes, one.text]) {
    const cell = document.createElement("td"), words = document.createElement("span");
    words.textContent = words.title = text;
    cell.append(words);
    found.append(cell);
  }
  return found;
}

function ages(now) {
  const age = (value) => (known(value) ? `last ${(value * 1e3).toFixed(0)} ms ago` : "never heard");
  const parts = [`Verdicts ${now.verdict_hz.toFixed(0)} Hz, ${age(now.verdict_age_s)}.`, `States ${now.state_hz.toFixed(0)} Hz, ${age(now.state_age_s)}.`];
  if (known(now.sample_age_s)) parts.push(`Sample ${(now.sample_age_s * 1e3).toFixed(1)} ms old when it was judged.`);
  if (known(now.compute_s)) parts.push(`Judging took ${(now.compute_s * 1e3).toFixed(2)} ms.`);
  return parts.join(" ");
}

function newest(part) {
  return Live.rows.length ? Live.rows[Live.rows.length - 1][part] : [];
}

// The last seconds as the drawings of the report know a run; times count back from now.
function table() {
  const { rows, setup, now } = Live, t = rows.map((one) => one[0] - now.t);
  const column = (part, k) => rows.map((one) => (known(one[part][k]) ? one[part][k] : null));
  const names = (setup.columns || []).map((name, k) => ({ name, values: column(2, k) })).filter((one) => one.values.some(known));
  const limits = (setup.limits || []).filter((limit) => names.some((one) => one.name === limit.of))
    .map((limit) => ({ of: limit.of, kind: limit.kind, steps: [[-SPAN_S, limit.value]] }));
  const changes = rows.map((one, k) => ({ time_s: t[k], level: one[1] })).filter((one, k, all) => !k || one.level !== all[k - 1].level);
  const view = { task: [], joints: [], places: [], planar: true, links: [], rails: [], loci: [], note: "", ...(setup.view || {}) };
  const joints = {};
  for (const link of view.links) if (link.axis) joints[link.joint] = column(4, link.joint);
  return {
    span: [-SPAN_S, 0], chapters: changes, view,
    tracks: [{ title: "Margins", unit: "1", t, breaks: [], columns: names, limits }],
    posture: {
      t, breaks: [], thinned: false, joints, pose: view.task.map((_, k) => column(3, k)),
      margin: rows.map((one) => one[2].slice(0, -1).reduce((least, value) => (known(value) ? Math.min(least, value) : least), Infinity)).map((value) => (Number.isFinite(value) ? value : null)),
    },
  };
}

function legend(track) {
  element("legend").replaceChildren(...track.columns.map((column, k) => {
    const entry = document.createElement("span"), swatch = document.createElement("i"), look = style(k);
    swatch.style.borderTop = `3px ${look.dash.length ? "dashed" : "solid"} ${look.colour}`;
    entry.append(swatch, column.name);
    return entry;
  }));
}

function scene(data, now) {
  const canvas = element("view"), { view } = data, pose = newest(3);
  element("view-note").textContent = Live.setup.note || view.note || (Live.setup.view ? "" : Live.setup.robot ? "The workspace is being computed." : "The robot is not known yet.");
  element("view-axes").textContent = view.task.map((one, k) => `${one.name} ${known(pose[k]) ? fixed(pose[k], 4) : "–"} ${one.unit}`).join(", ");
  if (!view.task.length) return;
  Live.place = grown(Live.place, extent(data));
  prepareView(canvas, data, Live.place);
  drawView(canvas, data, 0);
  box(canvas, data, now.box);
  const kinds = new Set(view.loci.map((locus) => locus.kind)), entries = [];
  if (kinds.has("type1")) entries.push(["solid", "soft", "Type 1 locus, boundary"]);
  if (kinds.has("type2")) entries.push(["dashed", "stop-ink", "Type 2 locus"]);
  entries.push(["solid", "focus", "reachable box: where the platform may get until it stands"]);
  if (element("view-legend").childElementCount !== entries.length + 1) {
    element("view-legend").innerHTML = entries.map(([how, colour, text]) => `<span><i style="border-top:3px ${how} var(--${colour})"></i>${text}</span>`).join("") +
      `<span><i class="ramp" style="background:linear-gradient(90deg,${RAMP})"></i>path by smallest margin, small to large</span>`;
  }
}

// What has to be seen only grows, or the picture would tremble.
function grown(before, now) {
  if (before === null) return now;
  const low = [0, 1].map((i) => Math.min(before.middle[i] - before.size[i] / 2, now.middle[i] - now.size[i] / 2));
  const high = [0, 1].map((i) => Math.max(before.middle[i] + before.size[i] / 2, now.middle[i] + now.size[i] / 2));
  return { middle: [0, 1].map((i) => (low[i] + high[i]) / 2), size: [0, 1].map((i) => high[i] - low[i]) };
}

function box(canvas, data, lines) {
  const pen = canvas.getContext("2d");
  pen.strokeStyle = theme("focus");
  pen.lineWidth = 1.5;
  pen.setLineDash([]);
  for (const one of lines) {
    pen.beginPath();
    for (const pose of one) {
      const at = [0, 0, 0];
      data.view.places.forEach((place, k) => { at[place] = pose[k]; });
      pen.lineTo(...View.to(flat(data, at)));
    }
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
    Live.place = null;
  });
  view.addEventListener("pointerup", () => { turning = null; });
}
setInterval(() => { if (!present()) lose(); }, WATCH_MS);
document.addEventListener("visibilitychange", () => { if (!present()) lose(); });
connect();
