"use strict";
// What is told in words and tables: the outcome, bounds next to responses, ages, notes, events, faults.

const cell = (content, className = "") => element("td", { className }, content);
// Cells of times; those that are unknown have a dash.
const times = (...all) => all.map(ns => cell(ns === null || Number.isNaN(ns) ? "–" : time(ns), "n"));

// Makes a table; heads that begin with `#` are those of numbers.
function table(caption, heads, rows) {
  const head = text => element("th", { scope: "col", className: text[0] === "#" ? "n" : "" }, text.replace("#", ""));
  const lines = [heads.map(head), ...rows].map(cells => element("tr", {}, ...cells));
  return element("table", {}, element("caption", {}, caption), ...lines);
}

// Tells the outcome in a line, and below it what a person has to know besides.
function showOutcome() {
  const { dags, policy, preemption, clusters, is_judged, breach_count, events, ms, lost, ...shown } = state.shown;
  const strong = (text, isBad) => element("b", { className: isBad ? "miss" : "" }, text);
  const misses = dags.reduce((sum, dag) => sum + dag.misses, 0), proven = dags.filter(dag => dag.bound_ns !== null);
  const order = { edf: "EDF", static: "static priorities" }[policy] ?? policy, rules = "rules R1 to R5";
  const held = breach_count ? strong(`breaches of the ${rules}: ${breach_count}`, true) : `${rules} hold`;
  const cores = clusters.length ? clusters.join(" + ") : shown.cores;
  const more = [...shown.warnings, ...shown.breaches.slice(0, 3).map(breach => breach.what)];
  $("say").replaceChildren(
    strong(`${proven.length} of ${dags.length}`), " DAGs proven · deadlines missed: ", strong(misses, misses),
    ` · ${order}, ${preemption === "on" ? "" : "not "}preemptive, cores: ${cores} · `,
    is_judged ? held : `${rules} not judged`, ` · ${events.toLocaleString("en")} events in ${ms.toFixed(0)} ms`,
    lost ? strong(` · ${lost} events are lost`, true) : "", ...more.map(text => element("div", {}, text)));
}

// Shows what was observed next to what is proven and allowed.
function showBounds() {
  const heads = ["DAG", "#period", "#jobs", "#median", "#longest", "#bound", "#deadline"];
  const rows = state.shown.dags.map(dag => {
    const { period_ns, deadline_ns, bound_ns, max_ns } = dag;
    const checked = !state.hidden.has(dag.name), title = "in timeline and picture";
    const isDrawn = element("input", { type: "checkbox", checked, title });
    isDrawn.onchange = () => { state.hidden[isDrawn.checked ? "delete" : "add"](dag.name); layOut(); redraw(); };
    const bar = element("div", { className: "scale", title: "blue: longest response, green: bound, red: deadline" });
    // Each on a scale of its own, which ends at its deadline or its longest response.
    const percent = ns => ns === null ? "-999%" : `${100 * ns / Math.max(deadline_ns, max_ns, 1)}%`;
    bar.style = `--longest: ${percent(max_ns)}; --proven: ${percent(bound_ns)}; --due: ${percent(deadline_ns)}`;
    const seen = dag.completed ? [dag.median_ns, max_ns] : [null, null];
    const [period, median, longest, ...limits] = times(period_ns, ...seen, bound_ns, deadline_ns);
    if (dag.is_sporadic) period.prepend("≥ ");
    median.title = `shortest ${time(dag.min_ns)}, 99 % up to ${time(dag.p99_ns)}`;
    const allowed_ns = Math.min(deadline_ns, (bound_ns ?? Infinity) + state.shown.tolerance_ns);
    longest.classList.toggle("miss", max_ns > allowed_ns);
    const why = bound_ns === null ? dag.why || "not proven" : dag.test || "as the record says";
    const name = element("label", {}, isDrawn, " ", element("b", {}, dag.name));
    return [cell(name), period, cell(dag.completed, "n"), median, longest, ...limits, cell(bar),
      cell(dag.misses, dag.misses ? "n miss" : "n"), cell(why, "why")];
  });
  heads.push("longest, bound, deadline", "#misses", "proven by, or why not");
  $("bounds").replaceChildren(table("Response times, bounds and deadlines", heads, rows));
}

// Shows how old it is what is read from DAG to DAG, and the links that it came by.
function showChains() {
  const figures = ({ median_ns, max_ns, bound_ns }) => {
    const cells = times(median_ns, max_ns, bound_ns);
    cells[1].classList.toggle("miss", max_ns > (bound_ns ?? Infinity) + state.shown.tolerance_ns);
    return cells;
  };
  const rows = state.shown.chains.map(({ names, output_age, data_age, reaction }) => [
    cell(names.join(" → "), "why"), ...[output_age, data_age, reaction].flatMap(figures)]);
  const heads = ["age of output", "age of data", "reaction"].flatMap(of => [`#${of}: median`, "#longest", "#bound"]);
  const chains = rows.length ? table("Chains from DAG to DAG", ["subtasks", ...heads], rows) : "";
  $("chains").replaceChildren(chains, element("pre", {}, state.shown.links.join("\n")));
}

let graphDrawn;

// Shows the graphs, and what is stated besides.
function showGraph() {
  const { graph, dags } = state.shown;
  // The engine writes names in the graph as text, and the page's policy lets no other script run. A
  // browser takes long to lay out a large graph, so a graph left unchanged by an edit is kept.
  const text = graph.length > 1_000_000 ? "The graph is too large to be drawn." : graph;
  if (graphDrawn !== text) $("graph").innerHTML = graphDrawn = text;
  const subtasks = dag => dag.subtasks.map(({ name, notes }) => ({ name: `${dag.name}/${name}`, notes }));
  const noted = dags.flatMap(dag => [dag, ...subtasks(dag)]).filter(({ notes }) => notes.length);
  const list = noted.flatMap(({ name, notes }) => [element("dt", {}, name), element("dd", {}, notes.join("; "))]);
  unfold("notes", list.length ? "Topics, types, tables and what else is stated" : "", list);
}

// Lists faults, modes, skips and breaches of the rules; each leads to its place in the timeline.
function showEvents() {
  const { breaches, marks } = state.shown, counts = {};
  const all = [...breaches.map(breach => ({ kind: "breach", ...breach })), ...marks];
  for (const { kind } of all) counts[kind] = (counts[kind] ?? 0) + 1;
  const items = all.slice(0, 200).map(({ ns, kind, what }) => {
    const onclick = () => look(ns - (view.to - view.from) / 2, ns + (view.to - view.from) / 2);
    return element("li", {}, element("button", { onclick }, `${time(ns)} ${kind}: ${what}`));
  });
  unfold("events", Object.entries(counts).map(([kind, count]) => `${kind}: ${count}`).join(" · "), items);
}

// Fills a part that a person can open; without a summary there is none.
function unfold(id, summary, children) {
  $(id).hidden = !summary;
  $(id).firstElementChild.textContent = summary;
  $(id).lastElementChild.replaceChildren(...children);
}

// Shows the faults of a file at their lines.
function showFaults(faults) {
  const lines = new Set(faults.map(fault => fault.line)), numbers = [""];
  // As few elements as can be: a file may have very many lines.
  for (let n = 1, count = $("dag").value.split("\n").length; n <= count; n++) {
    if (lines.has(n)) numbers.push(element("b", {}, `${n}\n`), ""); else numbers[numbers.length - 1] += `${n}\n`;
  }
  $("gutter").replaceChildren(...numbers);
  $("faults").replaceChildren(...faults.slice(0, 100).map(({ line, why }) => {
    const onclick = () => { if (line) goToLine(line); };
    return element("li", {}, element("button", { onclick }, line ? `line ${line}: ${why}` : why));
  }));
}

function goToLine(line) {
  const lines = $("dag").value.split("\n"), from = lines.slice(0, line - 1).join("\n").length + Math.min(1, line - 1);
  $("dag").focus();
  $("dag").setSelectionRange(from, from + lines[line - 1].length);
  $("dag").scrollTop = (line - 6) * parseFloat(getComputedStyle($("dag")).lineHeight);
}

// The comments at a file's head are its text for people.
function showAbout() {
  const lines = /^(#.*\n?|\s*\n)*/.exec($("dag").value)[0].match(/[^#\s].*/g)?.slice(0, 100) ?? [];
  const inCode = text => text.split("`").map((part, n) => n % 2 ? element("code", {}, part) : part);
  $("about").replaceChildren(...lines.map(line => element("p", {}, ...inCode(line))));
}
