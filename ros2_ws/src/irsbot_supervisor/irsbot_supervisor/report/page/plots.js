"use strict";
// Level strip and plots over time. They know the window and nothing of the cursor.

// Colours by name, until the theme changes: to ask the page for one takes as long as to draw a line.
const Theme = { number: 0, colours: new Map() };
{
  const forget = () => { Theme.number += 1; Theme.colours.clear(); };
  for (const change of ["(prefers-color-scheme: dark)", "print"]) matchMedia(change).addEventListener("change", forget);
  for (const change of ["beforeprint", "afterprint"]) addEventListener(change, forget);
}

function theme(name) {
  const { colours } = Theme;
  if (!colours.has(name)) colours.set(name, getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim());
  return colours.get(name);
}

// A canvas as large as it is shown, in CSS pixels; em: size of its letters.
function sheet(canvas) {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  canvas.width = Math.max(1, Math.round(width * ratio));
  canvas.height = Math.max(1, Math.round(height * ratio));
  const em = parseFloat(getComputedStyle(canvas).fontSize);
  return { pen: penOf(canvas, ratio, em), width, height, em, ratio };
}

function penOf(canvas, ratio, em) {
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.font = `${0.78 * em}px system-ui, sans-serif`;
  return pen;
}

// Where the plots begin and end on a canvas of that width.
function frame(width, em) {
  return { left: 3.8 * em, right: width - 0.6 * em };
}

// First row whose time is above t.
function after(times, t) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= t) low = middle + 1; else high = middle;
  }
  return low;
}

// The row that counts at a time: the newest one that is not later, else the first.
function rowAt(times, t) {
  return Math.max(0, after(times, t) - 1);
}

// Round steps that divide a range into about `count` parts.
function ticks(low, high, count) {
  const raw = (high - low) / count, size = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((k) => k * size).find((s) => s >= raw);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return { found, digits: Math.min(9, Math.max(0, -Math.floor(Math.log10(step) + 1e-9))) };
}

const DASHES = [[], [7, 3], [2, 2], [9, 3, 2, 3]];

function style(place) {
  return { colour: theme("l" + (place % 5)), dash: DASHES[Math.floor(place / 5) % DASHES.length] };
}

// Digits behind the point with which the values of a plot are told apart.
function digitsOf(track) {
  let most = 0;
  for (const { values } of track.columns) for (const value of values) if (value !== null) most = Math.max(most, Math.abs(value));
  return Math.min(9, Math.max(0, 3 - Math.floor(Math.log10(most || 1))));
}

// Without the sign of a zero.
function fixed(value, digits) {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text;
}

function levelAt(chapters, t) {
  return chapters[after(chapters.map((one) => one.time_s), t) - 1];
}

// Stretches of one level, [from, until, level], whatever the causes are in the meantime.
function stretches(data) {
  const found = [];
  for (const one of data.chapters) {
    const before = found[found.length - 1];
    if (before && before[2] === one.level) continue;
    if (before) before[1] = one.time_s;
    found.push([one.time_s, Math.max(data.span[1], one.time_s), one.level]);
  }
  return found;
}

// Every change is at least a pixel wide; ticks below it say where causes change.
function drawStrip({ pen, width, height, em }, data, window_) {
  const { left, right } = frame(width, em), [low, high] = window_;
  const x = (t) => left + (right - left) * (t - low) / (high - low);
  for (const [since, until, level] of stretches(data)) {
    const from = Math.max(left, x(since)), to = Math.min(right, Math.max(x(until), from + 1));
    if (to <= left || from >= right) continue;
    pen.fillStyle = theme(level.toLowerCase());
    pen.fillRect(from, 0, to - from, height);
    pen.fillStyle = theme(level.toLowerCase() + "-ink");
    if (since >= low) pen.fillRect(from, 0, 1, height);
    if (pen.measureText(level).width + 8 < to - from) pen.fillText(level, from + 4, height / 2 + 0.28 * em);
  }
  pen.fillStyle = theme("soft");
  for (const one of data.chapters) if (one.time_s >= low && one.time_s <= high) pen.fillRect(x(one.time_s), height - 3, 1, 3);
}

function drawTrack(canvas, track, data, window_, withTimes) {
  const { pen, width, height, em } = sheet(canvas), { left, right } = frame(width, em), [low, high] = window_;
  const bottom = height - (withTimes ? 1.5 * em : 0.35 * em), top = 0.35 * em;
  const first = Math.max(0, after(track.t, low) - 1), last = Math.min(track.t.length, after(track.t, high) + 1);
  const [least, most] = range(track, first, last, low, high);
  const x = (t) => left + (right - left) * (t - low) / (high - low);
  const y = (v) => bottom - (bottom - top) * (v - least) / (most - least);
  grid(pen, em, { left, right, top, bottom, low, high, least, most, x, y, withTimes });
  pen.save();
  pen.beginPath();
  pen.rect(left, 0, right - left, height);
  pen.clip();
  const breaks = new Set(track.breaks);
  track.columns.forEach((column, place) => {
    const look = style(place);
    pen.strokeStyle = pen.fillStyle = look.colour;
    for (const limit of track.limits) {
      if (limit.of === column.name || (limit.of === "" && place === 0)) drawLimit(pen, limit, x, y, low, high);
    }
    pen.setLineDash(look.dash);
    pen.lineWidth = Math.max(1, 2.8 - 0.7 * (place % 4)) * em / 16;  // what lies below another stays visible
    pen.globalAlpha = last - first > 2 * width ? 0.7 : 1;  // bands instead of lines: what lies below shows through
    drawLine(pen, track.t, column.values, breaks, first, last, x, y);
    pen.globalAlpha = 1;
  });
  pen.restore();
}

function range(track, first, last, low, high) {
  let least = Infinity, most = -Infinity;
  for (const column of track.columns) {
    for (let k = first; k < last; k++) {
      const value = column.values[k];
      if (value === null) continue;
      if (value < least) least = value;
      if (value > most) most = value;
    }
  }
  if (track.unit === "1" || track.unit === "ms" || track.unit === "N") least = Math.min(least, 0);
  for (const limit of track.limits) {
    if (track.unit === "1") for (const [, value] of limit.steps) most = Math.max(most, value);
  }
  if (!(least <= most)) [least, most] = [0, 1];
  const room = 0.06 * (most - least) || 0.05 * Math.abs(most) || 1;
  return [least === 0 ? 0 : least - room, most + room];
}

function grid(pen, em, at) {
  pen.lineWidth = 1;
  pen.strokeStyle = theme("grid");
  pen.fillStyle = theme("soft");
  pen.textAlign = "right";
  const rows = ticks(at.least, at.most, Math.max(2, (at.bottom - at.top) / (1.7 * em)));
  for (const value of rows.found) {
    line(pen, at.left, at.y(value), at.right, at.y(value));
    pen.fillText(value.toFixed(rows.digits), at.left - 0.4 * em, at.y(value) + 0.28 * em);
  }
  const times = ticks(at.low, at.high, Math.max(2, (at.right - at.left) / (6 * em)));
  pen.textAlign = "center";
  for (const t of times.found) {
    line(pen, at.x(t), at.top, at.x(t), at.bottom);
    if (at.withTimes) pen.fillText(t.toFixed(times.digits) + " s", Math.min(at.x(t), at.right - em), at.bottom + 1.1 * em);
  }
  pen.textAlign = "left";
}

function line(pen, x0, y0, x1, y1) {
  pen.beginPath();
  pen.moveTo(x0, y0);
  pen.lineTo(x1, y1);
  pen.stroke();
}

// A limit binds from its time on until the next one.
function drawLimit(pen, limit, x, y, low, high) {
  pen.setLineDash(limit.kind === "warn" ? [1, 5] : [2, 3]);
  pen.lineWidth = limit.kind === "warn" ? 1 : 1.6;
  limit.steps.forEach(([since, value], k) => {
    const until = k + 1 < limit.steps.length ? limit.steps[k + 1][0] : high;
    if (until > low && since < high) line(pen, x(Math.max(k ? since : low, low)), y(value), x(Math.min(until, high)), y(value));
  });
}

// A line that ends where nothing is known; a value alone is a dot.
function drawLine(pen, times, values, breaks, first, last, x, y) {
  pen.beginPath();
  let open = false, lone = null;
  pen.lineJoin = "bevel";
  const dots = [];
  for (let k = first; k < last; k++) {
    const value = values[k];
    if (value === null || breaks.has(k)) { if (lone) dots.push(lone); open = false; lone = null; }
    if (value === null) continue;
    const at = [x(times[k]), y(value)];
    if (open) { pen.lineTo(...at); lone = null; } else { pen.moveTo(...at); lone = at; }
    open = true;
  }
  if (lone) dots.push(lone);
  pen.stroke();
  for (const [px, py] of dots) { pen.beginPath(); pen.arc(px, py, 2, 0, 7); pen.fill(); }
}
