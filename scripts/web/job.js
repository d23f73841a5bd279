"use strict";
// The job that a person picks: its instances, and the values that it took and gave.

// Returns the place of a DAG's job in the columns, if it has one.
function jobOf(dag, number) {
  const { job_number } = state.shown, job = search(dag?.first ?? 0, dag?.last ?? 0, n => job_number[n] >= number);
  return job < dag?.last && job_number[job] === number ? job : undefined;
}

// Picks a job by its place, or none.
function pick(job) {
  const { dags, job_dag, job_number, job: numbers, subtask, from } = state.shown, dag = dags[job_dag[job]], slices = [];
  const number = job_number[job], last = dag?.base + dag?.subtasks.length;
  for (let n = 0; n < numbers.length; n++) {
    if (numbers[n] === number && subtask[n] >= dag.base && subtask[n] < last) slices.push(n);
  }
  slices.sort((a, b) => from[a] - from[b]);
  state.picked = dag && { dag, number, job, slices };
  later(writeAddress);
  redraw();
}

const ENDS = ["finished", "preempted", "waits", "ended by a fault", "still runs"];

// Tells how a job went.
function outcomeOf(job) {
  const { job_release, job_deadline, job_end, job_flags } = state.shown, response = job_end[job] - job_release[job];
  if (job_flags[job] & UNRELEASED) return "was not released";
  const open = job_flags[job] & ABORTED ? "was aborted" : "has not ended";
  const ended = Number.isNaN(response) ? open : `took ${time(response)}`;
  const due = job_flags[job] & MISSED ? "missed its deadline" : "has a deadline";
  return `${ended}, ${due} of ${time(job_deadline[job] - job_release[job])}`;
}

// Adds up the slices of each instance, and the gaps in which it stood in line.
function instancesOf(slices) {
  const { subtask, from, to, ready, end, names, core_names } = state.shown, instances = new Map();
  for (const n of slices) {
    const { until, ran = 0, waited = 0, preempted = 0, cores = [], gaps = [], ...first } =
      instances.get(subtask[n]) ?? { until: ready[n], ready: ready[n], start: from[n], name: names[subtask[n]].name };
    const next = end[n] === WAITS ? wokenOf(n) : to[n];
    instances.set(subtask[n], { ...first, until: next, finish: to[n], end: ENDS[end[n]], ran: ran + to[n] - from[n],
      waited: waited + next - to[n], preempted: preempted + (end[n] === PREEMPTED),
      cores: [...cores, core_names[coreOf(n)]], gaps: [...gaps, [until, from[n]]] });
  }
  return [...instances.values()];
}

// Tells what executed in the gaps, the longest first: that is why the instance stood in line.
function meanwhile(gaps) {
  const { first_of_core, cores, from, to, subtask, names, dags } = state.shown, sums = new Map();
  for (const [begin, end] of gaps) for (let core = 0; core < cores; core++) {
    const last = first_of_core[core + 1];
    for (let n = search(first_of_core[core], last, n => to[n] > begin); n < last && from[n] < end; n++) {
      sums.set(subtask[n], (sums.get(subtask[n]) ?? 0) + Math.min(to[n], end) - Math.max(from[n], begin));
    }
  }
  const longest = [...sums].filter(([, ns]) => ns > 0).sort((a, b) => b[1] - a[1]).slice(0, 3);
  return longest.map(([of, ns]) => `${dags[names[of].of].name}/${names[of].name} ${time(ns)}`).join(", ");
}

// Picks a job, or none, and tells of it; `isClicked`: where that is seen.
async function showJob(job, isClicked = false) {
  pick(job);
  $("job").replaceChildren();
  if (!state.picked) return;
  const { shown, picked } = state, { dag, number, slices } = picked, release = shown.job_release[job];
  const rows = instancesOf(slices).map(({ name, ready, start, finish, ran, waited, preempted, cores, gaps, end }) => [
    cell(name), ...times(ready - release, start - release, finish - release, ran, waited),
    ...times(finish - ready - ran - waited), cell(meanwhile(gaps), "why"), cell(preempted, "n"), cell(cores.join(", ")),
    cell(end)]);
  const numbers = ["#ready", "#start", "#finish", "#executed", "#waited", "#stood in line"];
  const caption = `Job ${number} of ${dag.name}, released at ${time(release)}, ${outcomeOf(job)}`;
  $("job").append(table(caption, ["subtask", ...numbers, "meanwhile on the cores", "#preempted", "on", "end"], rows));
  if (isClicked) $("job").scrollIntoView({ block: "nearest" });
  if (!(shown.job_flags[job] & HAS_VALUES)) return;
  const { of, words, body } = source();
  const { bytes } = await ask(`job of=${of} dag=${shown.dags.indexOf(dag)} job=${number}${words}`, body, false);
  if (!bytes || state.picked !== picked) return;
  const values = (read(bytes).values ?? []).map(({ subtask, way, topic, of, text }) => [
    ...[subtask, way, topic, of].map(text => cell(text)), cell(text, "why")]);
  $("job").append(table("Values that it took and gave", ["subtask", "", "topic", "of", "value"], values));
}
