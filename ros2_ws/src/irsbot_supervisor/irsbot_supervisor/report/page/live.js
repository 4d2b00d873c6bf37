"use strict";
// The live page. It asks for every few frames, so what it shows was true after it had asked; a frame that it had to wait
// for, or that grew old on the screen, is shown as NOT CONNECTED and never as a level.

const OLD_MS = 500, RETRY_MS = 1000, WATCH_MS = 100;
const READ_MS = 250;  // between two sets of figures that nobody reads faster
const Live = { socket: null, askedAt: -Infinity, firstT: null, frameAt: -Infinity, readAt: -Infinity, now: null, setup: {}, view: NO_VIEW, verdict: null, box: [], rows: [], changes: [], number: 0, drawing: null };

function connect() {
  const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
  Live.socket = socket;
  socket.onopen = () => { Live.rows = []; Live.changes = []; begin({}); ask(); };
  socket.onmessage = (event) => hear(JSON.parse(event.data));
  socket.onclose = () => { Live.socket = null; Live.frameAt = -Infinity; Live.now = null; lose(); setTimeout(connect, RETRY_MS); };
}

function begin(setup) {
  if (setup.robot !== Live.setup.robot || !Live.setup.view) Ground.place = null;
  Live.setup = setup;
  Live.view = { ...NO_VIEW, ...(setup.view || {}) };
  Live.number += 1;
}

function ask() {
  if (Live.socket === null || Live.socket.readyState !== WebSocket.OPEN) return;
  Live.askedAt = performance.now();
  Live.firstT = null;
  Live.socket.send("");
}

function hear({ setup, changes, verdict, box, rows, now, left }) {
  Live.firstT ??= now.t;
  Live.frameAt = Live.askedAt + 1e3 * (now.t - Live.firstT);  // the first of the frames was true after the question
  if (setup) begin(setup);
  if (changes) Live.changes = changes;
  if (verdict !== undefined) Live.verdict = verdict;
  if (box) Live.box = box;
  for (const row of rows) row.least = least(row);
  Live.rows.push(...rows);
  while (Live.rows.length && now.t - Live.rows[0][0] > SPAN_S) Live.rows.shift();
  Live.now = now;
  const hidden = document.hidden;  // a page that nobody sees asks for nothing
  if (!hidden && !left) ask();
  cancelAnimationFrame(Live.drawing);
  Live.drawing = requestAnimationFrame(() => { show(); if (hidden && !left) ask(); });
}

// Whether what is shown was true a moment ago.
const present = () => Live.now !== null && performance.now() - Live.frameAt <= OLD_MS;

// A page is laid out anew for every text that is set, even to what it was.
function say(node, text) { if (node.textContent !== text) node.textContent = text; }

function dress(node, name) { if (node.className !== name) node.className = name; }

// As many children as there are entries.
function asMany(parent, entries, make) {
  while (parent.childElementCount > entries) parent.lastElementChild.remove();
  while (parent.childElementCount < entries) parent.append(make());
  return [...parent.children];
}

function sayState(connected, level, title, text) {
  dress(document.body, connected ? "" : "lost");
  if (document.title !== title) document.title = title;
  dress(element("level"), connected ? level : "UNKNOWN");
  say(element("word"), level);
  say(element("why"), text);
}

function lose() {
  sayState(false, "NOT CONNECTED", "irsbot: not connected", Live.socket && Live.socket.readyState === WebSocket.OPEN ?
    "The page has heard nothing for a while: nothing is known of the robot." : "Nothing is known of the robot. The page tries again every second.");
}

// Pictures before texts: a picture asks for sizes, which would lay out the page once more.
function show() {
  if (!present()) { lose(); return; }
  const { now, setup, rows, view } = Live;
  drawLevels(element("strip"), rows, now.t);
  const places = drawMargins(element("margins"), rows, now.t, setup, Live.number);
  if (view.task.length) drawScene(element("view"), rows, now, Live.box, view, Live.number);
  sayState(true, now.level, `${now.level} ${setup.robot || "irsbot"}`, why(now));
  showTiles(tiles(now, setup));
  showChanges(now);
  legend(places.map((k) => setup.columns[k]));
  notes();
  if (performance.now() - Live.readAt < READ_MS) return;
  Live.readAt = performance.now();
  say(element("ages"), ages(now));
}

function why(now) {
  const { verdict } = Live;
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
    found.push([name, values[k].toFixed(4), limits, level]);
  });
  if (!found.length) found.push(["Margins", "not known", "no posture is known at present", "UNKNOWN"]);
  const left = now.time_to_stop;
  found.push(["Braking begins", known(left) ? `in ${left.toFixed(3)} s` : "not foreseen", "on the present course, at the latest", ""]);
  return found;
}

function showTiles(found) {
  const make = () => {
    const tile = document.createElement("div");
    tile.append(...["small", "b", "small"].map((tag) => document.createElement(tag)));
    return tile;
  };
  asMany(element("tiles"), found.length, make).forEach((tile, k) => {
    dress(tile, `tile ${found[k][3]}`);
    [...tile.children].forEach((part, i) => say(part, found[k][i]));
  });
}

function showChanges(now) {
  const make = () => {
    const row = document.createElement("tr");
    for (let k = 0; k < 4; k++) row.append(document.createElement("td"));
    for (const cell of row.children) cell.append(document.createElement("span"));
    return row;
  };
  const { changes } = Live;
  asMany(element("changes"), changes.length, make).forEach((row, k) => {
    const one = changes[changes.length - 1 - k], texts = [(now.t - one.t).toFixed(1), one.level, one.causes, one.text];
    dress(row, one.level);
    [...row.children].forEach((cell, i) => {
      say(cell.firstChild, texts[i]);
      if (cell.firstChild.title !== texts[i]) cell.firstChild.title = texts[i];
    });
  });
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

// The smallest margin of a row, and of the states before it; the last column is no margin of the present.
function least([, , columns, , low]) {
  const margins = [...columns.slice(0, -1), ...low.slice(0, -1)].filter(known);
  return margins.length ? Math.min(...margins) : 0;
}

function legend(names) {
  const key = [Theme.number, ...names].join();
  if (element("legend").dataset.key === key) return;
  element("legend").dataset.key = key;
  element("legend").replaceChildren(...names.map((name, k) => {
    const entry = document.createElement("span"), swatch = document.createElement("i"), look = style(k);
    swatch.style.borderTop = `3px ${look.dash.length ? "dashed" : "solid"} ${look.colour}`;
    entry.append(swatch, name);
    return entry;
  }));
}

function notes() {
  const { setup, view } = Live, pose = newest(3);
  say(element("view-note"), setup.note || view.note || (setup.view ? "" : setup.robot ? "The workspace is being computed." : "The robot is not known yet."));
  say(element("view-axes"), view.task.map((one, k) => `${one.name} ${known(pose[k]) ? fixed(pose[k], 4) : "–"} ${one.unit}`).join(", "));
  const legend_ = element("view-legend"), key = String(Live.number);
  if (!view.task.length || legend_.dataset.key === key) return;
  legend_.dataset.key = key;
  const entries = [...lociEntries(view), ["solid", "focus", "reachable box: where the platform may get until it stands"]];
  legend_.innerHTML = entries.map(([how, colour, text]) => `<span><i style="border-top:3px ${how} var(--${colour})"></i>${text}</span>`).join("") +
    `<span><i class="ramp" style="background:linear-gradient(90deg,${RAMP})"></i>path by smallest margin, small to large</span>`;
}

setInterval(() => { if (!present()) lose(); }, WATCH_MS);
document.addEventListener("visibilitychange", () => { if (!present()) lose(); });
connect();
