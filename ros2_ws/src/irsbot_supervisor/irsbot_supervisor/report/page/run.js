"use strict";
// One function feeds the page: update(data). A run that goes on calls it again.

const Run = { data: null, cursor: 0, window: [0, 1], digits: [], playing: null, waiting: null };
const element = (id) => document.getElementById(id);

function update(data) {
  const first = Run.data === null;
  Run.data = data;
  if (first) {
    Run.window = [...data.span];
    Run.cursor = beginning(data);
  }
  Run.digits = data.tracks.map(digitsOf);
  tiles(data);
  build(data);
  redrawAll();
}

// Where something is to be seen: at the first stop, else at the smallest margin.
function beginning(data) {
  const [stop] = data.summary.stops, [least] = [...data.summary.smallest_margins].sort((a, b) => a.value - b.value);
  return (stop || least || { time_s: data.span[0] }).time_s;
}

function tiles(data) {
  const { summary } = data, { verdict } = summary, worst = verdict.worst_at_work;
  const all = [tile("Verdict", worst || "never worked", worst ?
    `the worst since work began; ${verdict.last} at the end` : `no OK and no WARN in the whole run; ${verdict.last} at the end`, worst || "UNKNOWN")];
  for (const one of summary.smallest_margins) {
    const where = Object.entries(one.pose).map(([name, value]) => `${name} ${fixed(value, 3)}`).join(", ");
    const below = one.value < one.stop_limit;
    all.push(tile(`Smallest ${one.margin}`, one.value.toFixed(4), `stop limit ${one.stop_limit}${below ? ", crossed" : ""}; ${where}`,
      below ? "STOP" : "", one.time_s));
  }
  if (!summary.smallest_margins.length) all.push(tile("Margins", "none", "no posture was known"));
  const stop = summary.stops[0];
  if (stop) {
    const more = summary.stops.length > 1 ? `; first of ${summary.stops.length}` : "";
    const rest = stop.until_rest_s === null ? "no standstill" : `${(stop.until_rest_s * 1e3).toFixed(1)} ms`;
    all.push(tile(`${stop.level} until standstill`, rest, `${(stop.platform_m * 1e3).toFixed(1)} mm of the platform${more}`, "", stop.time_s));
  } else all.push(tile("Stops", "none", "nothing ended work"));
  const reasons = Object.entries(summary.rejected).map(([cause, count]) => `${cause} ${count}`);
  all.push(tile("Rejected joint states", String(Object.values(summary.rejected).reduce((a, b) => a + b, 0)),
    `${reasons.join(", ") || "none"}; of ${summary.samples} in ${summary.seconds.toFixed(3)} s`));
  element("tiles").replaceChildren(...all);
}

function tile(title, value, text, level, time_s) {
  const found = document.createElement("div"), [head, figure, foot] = ["small", "b", "small"].map((tag) => document.createElement(tag));
  found.className = `tile ${level || ""}`;
  [head.textContent, figure.textContent, foot.textContent] = [title, value, text];
  found.append(head, figure, foot);
  if (time_s !== undefined) foot.append("; ", jump(time_s));
  return found;
}

function jump(time_s) {
  const button = document.createElement("button");
  button.dataset.time = time_s;
  button.textContent = `at ${time_s.toFixed(3)} s`;
  return button;
}

// The elements of plots and legends; their number depends on the robot alone.
function build(data) {
  const figures = data.tracks.map((track, place) => {
    const figure = document.createElement("figure"), caption = document.createElement("figcaption");
    const name = document.createElement("b"), readout = document.createElement("span"), canvas = document.createElement("canvas");
    figure.className = place ? "track" : "track first";
    readout.className = "readout";
    name.textContent = `${track.title} [${track.unit}]`;
    track.columns.forEach((column, k) => {
      const entry = document.createElement("span"), swatch = document.createElement("i"), value = document.createElement("output");
      swatch.className = `line${k}`;
      entry.append(swatch, `${column.name} `, value);
      readout.append(entry);
    });
    caption.append(name, readout);
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${track.title} over time`);
    figure.append(caption, canvas);
    return figure;
  });
  element("tracks").replaceChildren(element("strip"), ...figures, element("cursor"));
  const most = Math.max(...maximum(data.posture.margin)).toFixed(2);
  element("view-legend").innerHTML = lociEntries(data.view).map(([how, colour, text]) => `<span><i style="border-top:3px ${how} var(--${colour})"></i>${text}</span>`).join("") +
    `<span><i class="ramp" style="background:linear-gradient(90deg,${RAMP})"></i>path by smallest margin, 0 to ${most}</span>` +
    "<span>changes to ● OK ▲ WARN ■ STOP ◆ UNKNOWN</span>";
  element("view-note").textContent = data.view.note + (data.view.planar ? "" : " Drag turns the view.");
}

function redrawAll() {
  prepareView(element("view"), Run.data);
  redraw();
}

// The plots alone: the path does not depend on the window.
function redraw() {
  const { data } = Run;
  drawStrip(sheet(element("strip")), data, Run.window);
  document.querySelectorAll(".track").forEach((figure, place) => {
    drawTrack(figure.querySelector("canvas"), data.tracks[place], data, Run.window, place % 3 === 0 || place === data.tracks.length - 1);
    figure.querySelectorAll(".readout i").forEach((swatch, k) => {
      const look = style(k);
      swatch.style.borderTop = `3px ${look.dash.length ? "dashed" : "solid"} ${look.colour}`;
    });
  });
  showCursor();
}

function redrawView() {
  prepareView(element("view"), Run.data);
  drawView(element("view"), Run.data, Run.cursor);
}

function showCursor() {
  const { data, cursor } = Run, strip = element("strip"), { left, right } = frame(strip.clientWidth, parseFloat(getComputedStyle(strip).fontSize));
  const share = (cursor - Run.window[0]) / (Run.window[1] - Run.window[0]), mark_ = element("cursor");
  mark_.className = "";
  mark_.style.width = "";
  mark_.style.visibility = share >= 0 && share <= 1 ? "visible" : "hidden";
  mark_.style.left = `${left + share * (right - left) - 1}px`;
  const chapter = levelAt(data.chapters, cursor), now = element("now"), level = document.createElement("b");
  level.textContent = chapter ? chapter.level : "no verdict yet";
  level.className = chapter ? chapter.level : "";
  now.replaceChildren(`${cursor.toFixed(4)} s `, level, chapter && chapter.causes ? ` ${chapter.causes}: ${chapter.text}` : "");
  document.querySelectorAll(".track").forEach((figure, place) => {
    const track = data.tracks[place], row = rowAt(track.t, cursor);
    figure.querySelectorAll("output").forEach((output, k) => {
      const value = track.columns[k].values[row];
      output.textContent = value === null || value === undefined ? "–" : fixed(value, Run.digits[place]);
    });
  });
  const row = rowAt(data.posture.t, cursor);
  element("view-axes").textContent = data.view.task.map((one, k) => {
    const value = data.posture.pose[k][row];
    return `${one.name} ${value === null || value === undefined ? "–" : fixed(value, 4)} ${one.unit}`;
  }).join(", ");
  drawView(element("view"), data, cursor);
  const slider = element("tracks");
  slider.setAttribute("aria-valuemin", data.span[0]);
  slider.setAttribute("aria-valuemax", data.span[1]);
  slider.setAttribute("aria-valuenow", cursor);
  slider.setAttribute("aria-valuetext", `${cursor.toFixed(4)} s, ${level.textContent}`);
}

function moveTo(t) {
  const [low, high] = Run.data.span, width = Run.window[1] - Run.window[0];
  Run.cursor = Math.min(high, Math.max(low, t));
  if (Run.cursor < Run.window[0] || Run.cursor > Run.window[1]) setWindow(Run.cursor - width / 2, Run.cursor + width / 2);
  else showCursor();
}

function setWindow(low, high) {
  const [least, most] = Run.data.span, width = Math.min(Math.max(high - low, 1e-4 * (most - least), 1e-4), most - least);
  const begin = Math.min(Math.max(low, least), most - width);
  Run.window = [begin, begin + width];
  cancelAnimationFrame(Run.waiting);
  Run.waiting = requestAnimationFrame(redraw);
}

function zoom(factor, about = Run.cursor) {
  setWindow(about - (about - Run.window[0]) * factor, about + (Run.window[1] - about) * factor);
}

function step(rows) {
  const { t } = Run.data.posture;
  moveTo(t[Math.min(t.length - 1, Math.max(0, rowAt(t, Run.cursor) + rows))]);
}

function change(way) {
  const times_ = Run.data.chapters.filter((one, k, all) => !k || one.level !== all[k - 1].level).map((one) => one.time_s);
  const next = way > 0 ? times_.find((t) => t > Run.cursor + 1e-9) : times_.filter((t) => t < Run.cursor - 1e-9).pop();
  if (next !== undefined) moveTo(next);
}

function play() {
  if (Run.playing !== null) { cancelAnimationFrame(Run.playing); Run.playing = null; return; }
  if (Run.cursor >= Run.data.span[1]) moveTo(Run.data.span[0]);
  let before = performance.now();
  const next = (now) => {
    moveTo(Run.cursor + (now - before) / 1e3);
    before = now;
    Run.playing = Run.cursor < Run.data.span[1] ? requestAnimationFrame(next) : null;
  };
  Run.playing = requestAnimationFrame(next);
}

function fit() {
  View.fit = View.fit === "all" ? "path" : "all";
  redrawView();
}

const ACTIONS = { previous: () => change(-1), next: () => change(1), play, in: () => zoom(0.5), out: () => zoom(2), all: () => setWindow(...Run.data.span), fit };
const KEYS = {
  ArrowLeft: (far) => step(far ? -10 : -1), ArrowRight: (far) => step(far ? 10 : 1),
  Home: () => moveTo(Run.data.span[0]), End: () => moveTo(Run.data.span[1]),
  PageUp: () => moveTo(Run.cursor - 0.1 * (Run.window[1] - Run.window[0])), PageDown: () => moveTo(Run.cursor + 0.1 * (Run.window[1] - Run.window[0])),
  n: ACTIONS.next, p: ACTIONS.previous, "+": ACTIONS.in, "-": ACTIONS.out, 0: ACTIONS.all, f: fit, " ": play,
};

document.addEventListener("click", (event) => {
  const button = event.target.closest("button");
  if (!button) return;
  if (button.dataset.do) ACTIONS[button.dataset.do]();
  if (button.dataset.time) moveTo(Number(button.dataset.time));
});
element("tracks").addEventListener("keydown", (event) => {
  const act = KEYS[event.key];
  if (!act || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  act(event.shiftKey);
});
{
  const tracks = element("tracks");
  const timeAt = (event) => {
    const box = element("strip").getBoundingClientRect(), { left, right } = frame(box.width, parseFloat(getComputedStyle(tracks).fontSize));
    return Run.window[0] + (Run.window[1] - Run.window[0]) * Math.min(1, Math.max(0, (event.clientX - box.left - left) / (right - left)));
  };
  let from = null;
  tracks.addEventListener("pointerdown", (event) => {
    tracks.setPointerCapture(event.pointerId);
    from = { t: timeAt(event), x: event.clientX, range: event.shiftKey };
    if (!from.range) moveTo(from.t);
  });
  tracks.addEventListener("pointermove", (event) => {
    if (from === null) return;
    if (!from.range) { moveTo(timeAt(event)); return; }
    const box = tracks.getBoundingClientRect(), mark_ = element("cursor");
    mark_.className = "range";
    mark_.style.left = `${Math.min(from.x, event.clientX) - box.left}px`;
    mark_.style.width = `${Math.abs(event.clientX - from.x)}px`;
  });
  const end = (event) => {
    if (from !== null && from.range && Math.abs(event.clientX - from.x) > 4) {
      const t = timeAt(event);
      setWindow(Math.min(t, from.t), Math.max(t, from.t));
    }
    from = null;
  };
  tracks.addEventListener("pointerup", end);
  tracks.addEventListener("pointercancel", () => { from = null; });
  tracks.addEventListener("wheel", (event) => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    zoom(event.deltaY > 0 ? 1.25 : 0.8, timeAt(event));
  }, { passive: false });

  const view = element("view");
  let turning = null;
  view.addEventListener("pointerdown", (event) => { turning = [event.clientX, event.clientY]; view.setPointerCapture(event.pointerId); });
  view.addEventListener("pointermove", (event) => {
    if (turning === null || Run.data.view.planar) return;
    View.turn = [View.turn[0] + (event.clientX - turning[0]) * 0.01, Math.min(1.5, Math.max(-1.5, View.turn[1] + (event.clientY - turning[1]) * 0.01))];
    turning = [event.clientX, event.clientY];
    redrawView();
  });
  view.addEventListener("pointerup", () => { turning = null; });
  view.addEventListener("dblclick", fit);
}
{
  let waiting = null;
  const later = () => { cancelAnimationFrame(waiting); waiting = requestAnimationFrame(redrawAll); };
  new ResizeObserver(later).observe(element("tracks"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", later);
  addEventListener("beforeprint", redrawAll);
  addEventListener("afterprint", later);
}
update(JSON.parse(element("data").textContent));
