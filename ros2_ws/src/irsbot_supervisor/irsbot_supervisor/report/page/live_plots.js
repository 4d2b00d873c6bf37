"use strict";
// The last seconds: level and margins. A margin is drawn once, on a roll of paper beside the page, of which each frame
// shows the newest part.

const SPAN_S = 30, APART_S = 0.5;
const ROLL = 1.5;  // length of the roll in lengths of the plot; at its end the last seconds are drawn on a new one
const Roll = { key: "", ground: null, paper: null, origin: 0, until: 0, ends: [] };
const Sizes = new Map();
const element = (id) => document.getElementById(id);
const known = (value) => value !== null && value !== undefined;

// A canvas of the page as `sheet` gives it, measured when it changes: to ask for a size lays out the page. number: another
// one for each size.
function sized(canvas) {
  const found = Sizes.get(canvas);
  if (found && found.ratio === (window.devicePixelRatio || 1)) return found;
  if (!found) new ResizeObserver(() => { Sizes.get(canvas).ratio = 0; }).observe(canvas);
  const fresh = { ...sheet(canvas), number: found ? found.number + 1 : 0 };
  Sizes.set(canvas, fresh);
  return fresh;
}

// A picture beside the page, CSS pixels; of the one before if there is one.
function beside(before, { ratio, em }, width, height) {
  const canvas = before || document.createElement("canvas");
  canvas.width = Math.max(1, Math.ceil(width * ratio));
  canvas.height = Math.max(1, Math.ceil(height * ratio));
  penOf(canvas, ratio, em);
  return canvas;
}

// The next round number that is not smaller, so that scales seldom change.
function above(value) {
  if (!(value > 0)) return 0;
  const step = 10 ** Math.floor(Math.log10(value)) / 5;
  return Math.ceil(value / step - 1e-9) * step;
}

function drawLevels(canvas, rows, now_s) {
  const at = sized(canvas), chapters = [];
  for (const row of rows) {
    if (!chapters.length || chapters[chapters.length - 1].level !== row[1]) chapters.push({ time_s: row[0] - now_s, level: row[1] });
  }
  at.pen.clearRect(0, 0, at.width, at.height);
  drawStrip(at, { span: [-SPAN_S, 0], chapters }, [-SPAN_S, 0]);
}

// names: of the columns. limits: [{ of, kind, value }]. number: another one for each setup. Returns the places of the
// columns that are drawn.
function drawMargins(canvas, rows, now_s, { columns = [], limits = [] }, number) {
  const at = sized(canvas), { pen, width, height, em, ratio } = at, { left, right } = frame(width, em);
  const places = columns.map((_, k) => k).filter((k) => rows.some((row) => known(row[2][k]) || known(row[4][k])));
  const bounds = limits.filter((limit) => places.some((k) => columns[k] === limit.of));
  const [least, most] = reach(rows, places, bounds), bottom = height - 1.5 * em, top = 0.35 * em, rate = (right - left) / SPAN_S;
  const y = (value) => bottom - (bottom - top) * (value - least) / (most - least);
  const key = [at.number, Theme.number, number, least, most, ...places].join();
  if (key !== Roll.key) {
    Roll.ground = beside(Roll.ground, at, width, height);
    const x = (t) => right + t * rate, under = Roll.ground.getContext("2d");
    grid(under, em, { left, right, top, bottom, low: -SPAN_S, high: 0, least, most, x, y, withTimes: true });
    for (const { of, kind, value } of bounds) {
      under.strokeStyle = style(places.findIndex((k) => columns[k] === of)).colour;
      drawLimit(under, { kind, steps: [[-SPAN_S, value]] }, x, y, -SPAN_S, 0);
    }
  }
  if (key !== Roll.key || now_s - Roll.origin > ROLL * SPAN_S || now_s < Roll.until) {
    Roll.paper = beside(Roll.paper, at, ROLL * (right - left), height);
    Object.assign(Roll, { key, origin: now_s - SPAN_S, until: -Infinity, ends: [] });
  }
  let first = rows.length;
  while (first > 0 && rows[first - 1][0] > Roll.until) first -= 1;
  const fresh = rows.slice(first), roll = Roll.paper.getContext("2d");
  places.forEach((k, place) => {
    const look = style(place);
    roll.strokeStyle = roll.fillStyle = look.colour;
    roll.setLineDash(look.dash);
    roll.lineWidth = Math.max(1, 2.8 - 0.7 * (place % 4)) * em / 16;  // what lies below another stays visible
    Roll.ends[place] = drawFresh(roll, fresh, k, Roll.ends[place] || null, (t) => (t - Roll.origin) * rate, y);
  });
  Roll.until = now_s;
  const dots = (value) => Math.round(value * ratio), wide = dots(right - left);
  pen.setTransform(1, 0, 0, 1, 0, 0);  // dots of the roll stay dots
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.drawImage(Roll.ground, 0, 0);
  pen.drawImage(Roll.paper, dots((now_s - SPAN_S - Roll.origin) * rate), 0, wide, Roll.paper.height, dots(left), 0, wide, Roll.paper.height);
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  return places;
}

// The rest of a line from its end, and what came between the looks: from the smallest to the largest value. A line ends
// where nothing is known; a value alone is a dot. Returns the new end.
function drawFresh(pen, rows, k, end, x, y) {
  pen.lineCap = "round";
  pen.lineDashOffset = end ? end.x : 0;
  pen.beginPath();
  const dots = [];
  for (const [t, , values, , low, high] of rows) {
    const here = known(values[k]) ? { t, x: x(t), y: y(values[k]), alone: true } : null;
    if (end && (!here || t - end.t > APART_S)) {
      if (end.alone) dots.push(end);
      end = null;
    }
    if (end) {
      pen.moveTo(end.x, end.y);
      pen.lineTo(here.x, here.y);
      here.alone = false;
    }
    if (known(low[k]) && !(here && Math.max(y(low[k]) - here.y, here.y - y(high[k])) < 0.5)) {
      pen.moveTo(x(t), y(low[k]));
      pen.lineTo(x(t), y(high[k]));
    }
    end = here;
  }
  pen.stroke();
  for (const dot of dots) { pen.beginPath(); pen.arc(dot.x, dot.y, 2, 0, 7); pen.fill(); }
  return end;
}

// What the scale has to hold, rounded.
function reach(rows, places, limits) {
  let least = 0, most = 0;
  for (const row of rows) {
    for (const part of [row[2], row[4], row[5]]) {
      for (const k of places) {
        if (part[k] > most) most = part[k];
        else if (part[k] < least) least = part[k];
      }
    }
  }
  for (const { value } of limits) most = Math.max(most, value);
  return [-1.03 * above(-least), 1.03 * above(most) || 1];
}
