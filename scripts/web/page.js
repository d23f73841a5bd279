"use strict";
// What a person does: edits, opens files, looks around; and a run that goes on, followed.

const timers = new Map();

// Does something once nothing has asked for it for a moment.
function later(what, ms = 200) {
  clearTimeout(timers.get(what));
  timers.set(what, setTimeout(what, ms));
}

// Shows an answer; returns whether it is one of a run.
function present({ bytes, ms, error }) {
  const { picked, file } = state;
  const answer = error ? { faults: [{ line: 0, why: error }] } : read(bytes);
  $("result").classList.toggle("stale", Boolean(answer.faults));
  showFaults(answer.faults ?? []);
  if (answer.faults && file) $("say").replaceChildren(element("b", { className: "miss" }, answer.faults[0].why));
  if (answer.faults) return false;
  // An answer that is not judged has no more than its picture.
  state.shown = { breach_count: 0, breaches: [], chains: [], links: [], ...answer, ms };
  prepare();
  layOut();
  showOutcome(); showBounds(); showChains(); showGraph(); showEvents();
  $("runs").hidden = answer.runs < 2;
  Object.assign($("run"), { max: answer.runs - 1, value: answer.run });
  if (view.isChosen) look(view.from, view.to); else lookAtFirst();
  // The text of a job is not written anew each second.
  (file?.isLive ? pick : showJob)(jobOf(answer.dags.find(dag => dag.name === picked?.dag.name), picked?.number));
  document.body.dataset.shown = 1 + Number(document.body.dataset.shown ?? 0);
  return true;
}

// Asks for what is played or seen.
function request(more = "", replaces = true) {
  const { of, words, body } = source();
  return ask(`${of}${more}${words}`, body, replaces);
}

async function play() {
  showAbout();
  $("example").value = state.example?.text === $("dag").value ? state.example.name : "";
  later(writeAddress);
  present(await request());
}

// Forgets what a person looked at: another run comes.
const forget = () => { view.isChosen = false; state.picked = undefined; };

const EDITING = "Edit the file: here is what is proven of it, and what the scheduler does, exactly.";

// Shows records instead of the editor, or the editor again.
function turnTo(file) {
  state.file = file;
  document.body.classList.toggle("seen", Boolean(file));
  $("back").hidden = !file || file.isLive;
  // An address holds a DAG file and the options, but no record.
  $("link").hidden = Boolean(file);
  $("mode").textContent = file?.parts.map(part => part.name).join(" and ") ?? EDITING;
}

// Opens records: first the picture; whether the rules hold takes longer.
async function open(parts, run = 0) {
  const file = { parts, run };
  turnTo(file);
  if (!present(await request(" judge=no"))) return;
  const { bytes, error } = await request("", false);
  if (state.file !== file) return;
  if (error) $("say").append(element("div", { className: "miss" }, error));
  if (!bytes) return;
  const { breaches, breach_count, is_judged, chains, links } = read(bytes);
  Object.assign(state.shown, { breaches, breach_count, is_judged, chains, links });
  showOutcome(); showChains(); showEvents(); redraw();
}

// Opens what was dropped or chosen: a DAG file to edit it, records to see them as one run.
async function openFiles(files) {
  const part = async file => ({ name: file.name, bytes: new Uint8Array(await file.arrayBuffer()) });
  const refuse = why => present({ error: `It cannot be read: ${why}` });
  const parts = await Promise.all([...files].map(part)).catch(({ message }) => refuse(message));
  // A text or a link that is dropped is no file.
  if (!parts?.length) return undefined;
  const dag = parts.find(({ name }) => name.endsWith(".dag"));
  forget();
  if (!dag) return open(parts);
  if (dag.bytes.length > MOST_TEXT) return refuse(`${dag.name} has more than ${MOST_TEXT} bytes`);
  turnTo(undefined);
  edit(undefined, new TextDecoder().decode(dag.bytes));
  return play();
}

// Follows a run that goes on: asks for what is new, and for all of it anew once it is over.
async function follow() {
  const part = { name: "A run that goes on", bytes: new Uint8Array() }, file = { parts: [part], run: 0, isLive: true };
  turnTo(file);
  $("say").ariaLive = "off";
  let isOver = false, seen = 0, restsUntil = 0;
  // The engine rests for as long as it has worked. Meanwhile the server is asked on, for at the end of the
  // run it waits for pages that ask.
  const showLatest = async () => {
    const begun = performance.now();
    [seen, restsUntil] = [part.bytes.length, Infinity];
    const answer = await request(" judge=no");
    const span = view.to - view.from, isAtEnd = !(view.to < state.shown?.end_ns);
    if (present(answer) && isAtEnd) look(state.shown.end_ns - Math.max(span, 2e8), state.shown.end_ns);
    restsUntil = 2 * performance.now() - begun;
  };
  while (state.file === file) {
    const answer = await fetch(`record?from=${part.bytes.length}`).catch(() => undefined);
    // A server that ends may cut it off.
    const content = await answer?.arrayBuffer().catch(() => undefined);
    if (!answer?.ok || !content) break;
    const isLast = answer.headers.get("record") === "over", isAnother = isLast && !isOver && part.bytes.length > 0;
    isOver ||= isLast;
    // Of a run that is over the record is another file, in which all is in order.
    part.bytes = isAnother ? new Uint8Array() : joined([part.bytes, new Uint8Array(content)]);
    if (isAnother || part.bytes.length < Number(answer.headers.get("bytes"))) continue;
    if (isOver) break;
    if (part.bytes.length > seen && performance.now() > restsUntil) showLatest();
    await new Promise(resolve => setTimeout(resolve, 1000));
  }
  const name = isOver ? "The run is over" : "The run's end did not come";
  if (state.file === file) open([{ name, bytes: part.bytes }]);
}

// Saves what the commands would have written of what is in view.
async function save(what, name) {
  const { of, words, body } = source(), part = [];
  if (what === "record" && of === "open") return state.file.parts.forEach(part => download(part.bytes, name));
  if (view.isChosen) part.push(["from", `${Math.floor(view.from)}ns`], ["to", `${Math.ceil(view.to)}ns`]);
  if (view.drawn.length < state.shown.dags.length) part.push(["dags", view.drawn.map(dag => dag.name)]);
  const line = `${what}${of === "play" ? "-of-play" : ""}${words}${what === "svg" ? asWords(part) : ""}`;
  const { bytes, error } = await ask(line, body, false);
  // A refusal has a head, as all other answers have.
  const why = bytes?.[4] === "{".charCodeAt(0) ? read(bytes).faults[0].why : error;
  if (why) $("say").append(element("div", { className: "miss" }, why)); else if (bytes) download(bytes, name);
}

const download = (bytes, download) => element("a", { href: URL.createObjectURL(new Blob([bytes])), download }).click();

// Goes to the miss after the picked one, or before it; round at the end.
function goToMiss(step) {
  const { misses, job_release, job_deadline } = state.shown, at = misses.indexOf(state.picked?.job) + step;
  const next = misses[at] ?? misses.at(Math.min(0, step)), from = job_release[next];
  if (next === undefined) return;
  const length = Math.max(endOf(next), job_deadline[next]) - from;
  look(from - length / 2, from + 1.5 * length);
  showJob(next);
}

// Picks the job that is released next of those in view, or the one before.
function goToJob(step) {
  const { dags, job_release, job_flags } = state.shown;
  const seen = dags.flatMap(dag => [...inView(dag.first, dag.last, n => job_release[n])]);
  const all = seen.filter(n => !(job_flags[n] & UNRELEASED)).sort((a, b) => job_release[a] - job_release[b]);
  if (all.length) showJob(all.at((all.indexOf(state.picked?.job) + step) % all.length));
}

// The buttons have these keys, too.
const keys = {
  0: lookAtAll, 1: lookAtFirst, "+": () => zoom(0.6), "-": () => zoom(1.6), n: () => goToMiss(1), N: () => goToMiss(-1),
  ArrowLeft: () => move(-0.2), ArrowRight: () => move(0.2), Enter: ({ shiftKey }) => goToJob(shiftKey ? -1 : 1),
  Escape: () => showJob(), p: () => save("svg", "schedule.svg"), r: () => save("record", "run.rec"),
  l: () => navigator.clipboard.writeText(location.href).then(() => { $("link").textContent = "Link copied"; }),
};

function onKey(event) {
  if (event.ctrlKey || event.metaKey || !keys[event.key]) return;
  event.preventDefault();
  keys[event.key](event);
}

// The pointers that are down, each with the instant that it was set upon.
const held = new Map();
let hasMoved = false;

function onPress(event) {
  hasMoved &&= held.size > 0;
  held.set(event.pointerId, { x: event.offsetX, now: event.offsetX, ns: nsOf(event.offsetX) });
  event.target.setPointerCapture(event.pointerId);
}

// One pointer moves the timeline, two also stretch it: what is under each stays there.
function onMove(event) {
  const pointer = held.get(event.pointerId);
  if (!pointer) return showTip(event);
  pointer.now = event.offsetX;
  hasMoved ||= Math.abs(pointer.now - pointer.x) > 3;
  const [one, two] = held.values(), isPinch = two && Math.abs(two.now - one.now) > 5;
  const perPixel = isPinch ? Math.abs((two.ns - one.ns) / (two.now - one.now)) : 1 / view.scale;
  const from = one.ns - (one.now - view.left) * perPixel;
  if (hasMoved) look(from, from + (view.width - view.left) * perPixel);
}

// A wheel without a key scrolls the page, on which the timeline may be tall.
function onWheel(event) {
  const isZoom = event.ctrlKey || event.metaKey, by = event.deltaX || (event.shiftKey ? event.deltaY : 0);
  if (isZoom || by) event.preventDefault();
  if (isZoom) zoom(1.0015 ** event.deltaY, nsOf(event.offsetX)); else if (by) move(by / view.width);
}

function showTip({ offsetX, offsetY, clientX, clientY }) {
  const { text = "" } = under(offsetX, offsetY), left = `${Math.min(clientX + 12, innerWidth - 200)}px`;
  Object.assign($("tip"), { hidden: !text, textContent: text, style: `left: ${left}; top: ${clientY + 14}px` });
}

function listen() {
  const on = (target, name, act) => target.addEventListener(name, act, { passive: false });
  const ifShown = act => event => { if (state.shown) act(event); };
  for (const id of ["dag", "options"]) on($(id), "input", () => later(play, 40));
  on($("dag"), "scroll", () => { $("gutter").scrollTop = $("dag").scrollTop; });
  on($("example"), "change", ({ target }) => { forget(); edit(target.value); play(); });
  on($("open"), "click", () => $("file").click());
  on($("file"), "change", ({ target }) => openFiles([...target.files]));
  on($("back"), "click", () => { forget(); turnTo(undefined); play(); });
  on($("run"), "change", ({ target }) => { forget(); open(state.file.parts, Number(target.value)); });
  on(window, "dragover", event => event.preventDefault());
  on(window, "drop", event => { event.preventDefault(); openFiles([...event.dataTransfer.files]); });
  on(window, "resize", ifShown(() => { layOut(); look(view.from, view.to, view.isChosen); }));
  on(window, "hashchange", begin);
  on(matchMedia("(prefers-color-scheme: dark)"), "change", ifShown(redraw));
  on($("bar"), "click", ifShown(event => keys[event.target.dataset.key]?.(event)));
  const acts = {
    keydown: onKey, wheel: onWheel, pointerdown: onPress, pointermove: onMove,
    pointerup: event => { if (!hasMoved) showJob(under(event.offsetX, event.offsetY).job, true); },
    lostpointercapture: event => held.delete(event.pointerId), pointerleave: () => { $("tip").hidden = true; },
  };
  for (const [name, act] of Object.entries(acts)) on($("time"), name, ifShown(act));
}

async function begin() {
  const cut = "The address holds no DAG file that can be read: it was cut, perhaps. Copy it once more.";
  const fault = await readAddress().catch(() => cut);
  if (LIVE) return follow();
  if (GIVEN.length) return open(GIVEN.map(({ name, data }) => ({ name, bytes: fromBase64(data) })));
  turnTo(undefined);
  if (fault) showFaults([{ line: 0, why: fault }]); else await play();
}

$("example").append(...EXAMPLES.map(({ name, file }) => new Option(/labs/.test(file) ? `lab: ${name}` : name, name)));
listen();
startEngine(ENGINE, new URLSearchParams(location.hash.slice(1)).has("sync")).then(begin);
