"use strict";
// The timeline: a row for each core with what it executed, and for each DAG with its jobs.
//
// Slices and jobs are columns of numbers, in the order of time within a core and a DAG. What is drawn
// is found in them by halves, and what is narrower than a pixel is drawn once a pixel: so a frame
// takes a time by the width of the screen, not by the length of the run.

const LETTER = 7, AXIS = 20, ROW = 26, HIGH = 18, LANE = 13, MOST_LANES = 6, MOST_HEIGHT = 16_000;
// The end of a slice, and the bits of a job.
const FINISHED = 0, PREEMPTED = 1, WAITS = 2, FAULT = 3, MISSED = 1, ABORTED = 2, UNRELEASED = 4, HAS_VALUES = 8;

const c = $("time").getContext("2d");

// Returns the first place from `low` on from which on `isAfter` holds.
function search(low, high, isAfter) {
  while (low < high) {
    const middle = (low + high) >> 1;
    if (isAfter(middle)) high = middle; else low = middle + 1;
  }
  return low;
}

// Yields the places whose times are in view, at most one a pixel; `at` gives the times, which rise.
function* inView(low, high, at, reach = 0) {
  for (let n = search(low, high, n => at(n) >= view.from - reach); n < high && at(n) <= view.to;) {
    yield n;
    const least = at(n) + 1 / view.scale;
    n = search(n + 1, high, n => at(n) >= least);
  }
}

const coreOf = slice => search(0, state.shown.cores, core => state.shown.first_of_core[core + 1] > slice);
const orEnd = ns => Number.isNaN(ns) ? state.shown.end_ns : ns;
const endOf = job => orEnd(state.shown.job_end[job]);
const wokenOf = slice => orEnd(state.shown.woken[slice]);
const xOf = ns => view.left + (ns - view.from) * view.scale;
const nsOf = x => view.from + (x - view.left) / view.scale;
const middleOf = slice => AXIS + ROW * coreOf(slice) + ROW / 2 - 1;

// Prepares an answer: sums and lanes that each frame needs.
function prepare() {
  const { shown } = state, { dags, marks, job_dag, job_release, job_deadline, job_flags, from, to } = shown;
  shown.names = dags.flatMap((dag, of) => dag.subtasks.map(({ name }, n) => ({ of, name: name || `subtask ${n}` })));
  // How long the cores had been busy before each slice, so that the load of a pixel is a difference.
  shown.busy = new Float64Array(from.length + 1);
  for (let n = 0; n < from.length; n++) shown.busy[n + 1] = shown.busy[n] + to[n] - from[n];
  shown.plan_reach = shown.plan_from.reduce((most, from, n) => Math.max(most, shown.plan_to[n] - from), 0);
  dags.forEach((dag, of) => {
    const first = search(0, job_dag.length, n => job_dag[n] >= of);
    const last = search(first, job_dag.length, n => job_dag[n] > of);
    const base = shown.names.findIndex(name => name.of === of), lane = new Uint8Array(last - first);
    Object.assign(dag, { first, last, base, lane, missed: [] });
    // A mark of the whole run stands with the first DAG.
    dag.marks = marks.filter(mark => (mark.dag ?? 0) === of);
    dag.reach = dag.deadline_ns;
    // Each job gets the first lane that is free; beyond the most they lie over each other.
    const free = [];
    for (let n = first; n < last; n++) {
      if (job_flags[n] & UNRELEASED) continue;
      const found = free.findIndex(until => until <= job_release[n]);
      lane[n - first] = found < 0 ? free.length % MOST_LANES : found;
      free[lane[n - first]] = endOf(n);
      dag.reach = Math.max(dag.reach, endOf(n) - job_release[n]);
      if (job_flags[n] & MISSED) dag.missed.push(n);
    }
    dag.lanes = Math.max(1, free.length);
  });
  shown.misses = dags.flatMap(dag => dag.missed).sort((a, b) => job_deadline[a] - job_deadline[b]);
}

// Gives the DAGs that are drawn their places.
function layOut() {
  const { dags, cores, core_names } = state.shown;
  view.drawn = dags.filter(dag => !state.hidden.has(dag.name));
  view.height = AXIS + cores * ROW + 10;
  for (const dag of view.drawn) {
    dag.y = view.height;
    view.height = Math.min(dag.y + dag.lanes * LANE + 14, MOST_HEIGHT);
  }
  const longest = Math.max(...[...core_names, ...dags.map(dag => dag.name)].map(name => name.length));
  view.width = c.canvas.clientWidth;
  view.left = Math.min(20 + LETTER * longest, 170, view.width / 4);
}

// Shows the time from one instant to another.
function look(from, to, isChosen = true) {
  // So short that two labels of the axis are two numbers, even centuries from 0. An address may say NaN.
  const all = Math.max(1, state.shown.end_ns) * 1.01, least = Math.max(20, all * 2 ** -44);
  const span = Math.min(Math.max(to - from || 0, least), all);
  const begin = Math.min(Math.max(0, from || 0), all - span);
  Object.assign(view, { from: begin, to: begin + span, scale: (view.width - view.left) / span, isChosen });
  later(writeAddress);
  redraw();
}

const lookAtAll = () => look(0, Infinity);
const lookAtFirst = () => look(0, 2 * Math.max(...state.shown.dags.flatMap(dag => [dag.period_ns, dag.max_ns])), false);
const move = by => look(view.from + by * (view.to - view.from), view.to + by * (view.to - view.from));
// Shows a factor of the time in view; the instant `ns` stays where it is.
const zoom = (factor, ns = nsOf((view.left + view.width) / 2)) =>
  look(ns - (ns - view.from) * factor, ns + (view.to - ns) * factor);

const redraw = () => { view.planned ??= requestAnimationFrame(() => { view.planned = undefined; draw(); }); };

function draw() {
  const { canvas } = c, ratio = devicePixelRatio, style = getComputedStyle(canvas), colours = {};
  const { width, height, left, drawn } = view;
  view.colour = name => colours[name] ??= style.getPropertyValue(`--${name}`);
  canvas.style.height = `${height}px`;
  // That clears it, too.
  [canvas.width, canvas.height] = [width, height].map(side => Math.round(side * ratio));
  c.scale(ratio, ratio);
  Object.assign(c, { font: "12px system-ui, sans-serif", textBaseline: "middle" });
  drawAxis();
  c.save(); c.beginPath(); c.rect(left, 0, width - left, height); c.clip();
  for (let core = 0; core < state.shown.cores; core++) drawCore(core);
  drawTables();
  drawn.forEach(drawJobs);
  drawHops();
  if (state.picked?.slices) drawPicked(state.picked);
  for (const breach of state.shown.breaches) fill("breach", xOf(breach.ns) - 1, 0, 3, AXIS);
  c.restore();
  c.fillStyle = view.colour("ink");
  state.shown.core_names.forEach((name, core) => c.fillText(name, 8, AXIS + core * ROW + ROW / 2, left - 12));
  for (const dag of drawn) c.fillText(dag.name, 8, dag.y + dag.lanes * LANE / 2, left - 12);
}

const fill = (colour, ...box) => { c.fillStyle = view.colour(colour); c.fillRect(...box); };

function drawAxis() {
  const least = 90 / view.scale, power = 10 ** Math.floor(Math.log10(least));
  const step = Math.max(1, [1, 2, 5, 10].map(n => n * power).find(ns => ns >= least));
  // All labels have one unit, that of the whole view, and as many digits as tell two of them apart.
  const [unit, name] = UNITS.find(([unit]) => view.to - view.from >= unit);
  const digits = Math.max(0, Math.ceil(Math.log10(unit / step) - 1e-9));
  for (let ns = Math.ceil(view.from / step) * step; ns <= view.to; ns += step) {
    fill("line", Math.round(xOf(ns)), AXIS - 4, 1, view.height);
    c.fillStyle = view.colour("soft");
    c.fillText(`${(ns / unit).toFixed(digits)} ${name}`, xOf(ns) + 3, 9);
  }
}

function drawCore(core) {
  const { first_of_core, from, to, subtask, busy, names, colours } = state.shown, last = first_of_core[core + 1];
  const top = AXIS + core * ROW + 3, after = ns => search(first_of_core[core], last, n => to[n] > ns);
  for (let n = after(view.from), next; n < last && from[n] < view.to; n = next) {
    const left = xOf(from[n]), width = xOf(to[n]) - left;
    c.fillStyle = colours[subtask[n] % colours.length];
    next = n + 1;
    if (width >= 1.5) {
      c.fillRect(left, top, width, HIGH);
      drawEnd(n, left, width, top);
      drawLabel(names[subtask[n]].name, left, left + width, top + HIGH / 2 + 1);
      continue;
    }
    // Two pixels at a time, as high as the core was busy in them.
    next = Math.max(next, after(nsOf(Math.floor(left) + 2)));
    const tall = Math.max(2, HIGH * Math.min(1, (busy[next] - busy[n]) * view.scale / 2));
    if (next > n + 1) c.fillStyle = view.colour("load");
    c.fillRect(Math.floor(left), top + HIGH - tall, 2, tall);
  }
}

// The entries of tables, in thin bars above what their cores executed; the first late one is red.
function drawTables() {
  const { plan_from, plan_to, plan_subtask, plan_core, plan_late, plan_reach, colours } = state.shown;
  for (const n of inView(0, plan_from.length, n => plan_from[n], plan_reach)) {
    c.fillStyle = plan_late[n] ? view.colour("miss") : colours[plan_subtask[n] % colours.length];
    const width = Math.max(1, (plan_to[n] - plan_from[n]) * view.scale);
    c.fillRect(xOf(plan_from[n]), AXIS + plan_core[n] * ROW - 2, width, plan_late[n] ? 5 : 4);
  }
}

// A slice has an outline, and at its end a dark edge if it was preempted, a red one at a fault; a wait
// goes on below as a thin bar.
function drawEnd(n, left, width, top) {
  const end = state.shown.end[n], right = left + width, edge = Math.min(3, width / 3);
  if (end === WAITS) c.fillRect(right, top + HIGH + 1, xOf(wokenOf(n)) - right, 3);
  c.strokeStyle = "#33415588";
  if (width > 4) c.strokeRect(left + 0.5, top + 0.5, width - 1, HIGH - 1);
  if (end === PREEMPTED || end === FAULT) fill(end === FAULT ? "miss" : "dark", right - edge, top, edge, HIGH);
}

// Writes a text where it fits, from the visible left end on.
function drawLabel(text, left, right, y) {
  const begin = Math.max(left, view.left);
  c.fillStyle = view.colour("dark");
  if (Math.min(right, view.width) - begin > LETTER * text.length + 4) c.fillText(text, begin + 4, y);
}

function drawJobs(dag) {
  const { job_release, job_deadline, job_end, job_flags } = state.shown, { first, missed, marks, bound_ns } = dag;
  const upright = (colour, ns, left) => fill(colour, xOf(ns) - left, dag.y - 2, 2, dag.lanes * LANE + 3);
  for (const n of inView(first, dag.last, n => job_release[n], dag.reach)) {
    const isUnreleased = job_flags[n] & UNRELEASED, top = dag.y + dag.lane[n - first] * LANE;
    const left = xOf(job_release[n]), right = isUnreleased ? left + 3 : xOf(endOf(n));
    const colour = job_flags[n] & MISSED ? "late" : isUnreleased ? "skip" : "job";
    fill(colour, left, top, Math.max(1, right - left), LANE - 2);
    if (isUnreleased || dag.period_ns * view.scale < 9) continue;
    upright("soft", job_release[n], 0);
    upright("miss", job_deadline[n], 2);
    if (bound_ns !== null) upright("bound", job_release[n] + bound_ns, 1);
    if (!Number.isNaN(job_end[n])) drawLabel(time(job_end[n] - job_release[n]), left, right, top + 6);
  }
  // However many jobs a pixel has, a mark is seen, and above it a miss.
  for (const n of inView(0, marks.length, n => marks[n].ns)) {
    c.fillStyle = view.colour({ fault: "miss", mode: "run" }[marks[n].kind] ?? "skip");
    c.beginPath(); c.arc(xOf(marks[n].ns), dag.y - 5, 3.5, 0, 7); c.fill();
  }
  c.fillStyle = view.colour("miss");
  for (const n of inView(0, missed.length, n => job_deadline[missed[n]])) {
    const x = xOf(job_deadline[missed[n]]), y = dag.y - 2;
    c.beginPath(); c.moveTo(x, y); c.lineTo(x - 4, y - 7); c.lineTo(x + 4, y - 7); c.fill();
  }
}

// Draws an arrow from the end of one slice to the begin of another, later one.
function drawArrow(before, after) {
  const x = xOf(state.shown.from[after]), y = middleOf(after);
  c.beginPath(); c.moveTo(xOf(state.shown.to[before]), middleOf(before)); c.lineTo(x, y);
  c.moveTo(x - 6, y - 4); c.lineTo(x, y); c.lineTo(x - 6, y + 4); c.stroke();
}

// Messages between machines, where a pixel has not too many.
function drawHops() {
  const { hop_from = [], hop_to, from, to } = state.shown;
  c.strokeStyle = view.colour("run");
  hop_from.forEach((sent, n) => {
    const begin = to[sent], end = from[hop_to[n]];
    if (end >= view.from && begin <= view.to && (end - begin) * view.scale > 2) drawArrow(sent, hop_to[n]);
  });
}

// The picked job: its slices in frames, and arrows from each end to the begins that waited for it.
function drawPicked({ dag, slices, job }) {
  const { from, to, subtask, end, job_release } = state.shown;
  const frame = (from, to, y, height) => c.strokeRect(xOf(from), y, Math.max(2, xOf(to) - xOf(from)), height);
  Object.assign(c, { strokeStyle: view.colour("ink"), lineWidth: 2 });
  if (view.drawn.includes(dag)) frame(job_release[job], endOf(job), dag.y + dag.lane[job - dag.first] * LANE, LANE - 2);
  for (const n of slices) frame(from[n], to[n], AXIS + coreOf(n) * ROW + 3, HIGH);
  c.lineWidth = 1;
  for (const n of slices) for (const next of end[n] === FINISHED ? dag.subtasks[subtask[n] - dag.base].next : []) {
    const begin = slices.find(slice => subtask[slice] === dag.base + next);
    if (begin !== undefined) drawArrow(n, begin);
  }
}

// Returns what is at a place of the canvas: a text, and the job.
function under(x, y) {
  const { shown } = state, { from, to, first_of_core, job_release } = shown;
  const ns = nsOf(x), core = Math.floor((y - AXIS) / ROW);
  if (core >= 0 && core < shown.cores) {
    const n = search(first_of_core[core], first_of_core[core + 1], n => to[n] > ns);
    if (n >= first_of_core[core + 1] || from[n] > ns) return {};
    const { of, name } = shown.names[shown.subtask[n]], dag = shown.dags[of], end = ENDS[shown.end[n]];
    const text = `${name} of ${dag.name} #${shown.job[n]}, ${time(from[n])} to ${time(to[n])}, ${end}`;
    return { text, job: jobOf(dag, shown.job[n]) };
  }
  const dag = view.drawn.find(dag => y >= dag.y - 10 && y < dag.y + dag.lanes * LANE);
  const mark = y < dag?.y && dag.marks.find(mark => Math.abs(xOf(mark.ns) - x) < 5);
  if (mark) return { text: `${time(mark.ns)} ${mark.kind}: ${mark.what}` };
  const isAt = n => dag.lane[n - dag.first] === Math.floor((y - dag.y) / LANE) && endOf(n) >= ns;
  let job = dag ? search(dag.first, dag.last, n => job_release[n] > ns) - 1 : -1;
  while (job >= dag?.first && !isAt(job) && job_release[job] > ns - dag.reach) job--;
  if (!(job >= dag?.first) || !isAt(job)) return {};
  return { text: `${dag.name} #${shown.job_number[job]} ${outcomeOf(job)}`, job };
}
