"use strict";
// The state of the page: what is played or seen, the options, the view; and the same as an address.

// `file`: the records that are seen instead of the editor's text. `shown`: the latest answer.
// `picked`: the job whose instances are listed. `hidden`: the names of DAGs that are not drawn.
const state = { file: undefined, example: undefined, shown: undefined, picked: undefined, hidden: new Set() };
// `isChosen`: by a person, so that a new answer leaves it as it is.
const view = { from: 0, to: 1, isChosen: false };

const $ = id => document.getElementById(id);

// Makes an element. Whatever a file says comes into the page as text, never as HTML.
function element(name, properties, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

// The most bytes of a file for the editor: a browser's editor does not bear more, the commands do.
const MOST_TEXT = 1_000_000;

const UNITS = [[1e9, "s"], [1e6, "ms"], [1e3, "us"], [1, "ns"]];

// Shows a time as the commands do.
function time(ns) {
  if (ns === 0) return "0";
  const [unit, name] = UNITS.find(([unit]) => Math.abs(ns) >= unit) ?? UNITS.at(-1);
  return `${Math.trunc(ns / unit * 1000 + 1e-6) / 1000} ${name}`;
}

const nameOf = word => `${word}`.replace(/[\s%]/g, letter => encodeURIComponent(letter));
const asWords = pairs => pairs.map(([name, value]) => ` ${name}=${nameOf(value)}`).join("");
const options = () => [...new FormData($("options"))].filter(([, value]) => value.trim());

// Returns the request for what is played or seen: its words, and the file.
function source() {
  const { file, example } = state;
  const app = example?.words.app ? [["app", example.words.app]] : [], text = new TextEncoder().encode($("dag").value);
  if (!file) return { of: "play", words: asWords([...options(), ...app]), body: text };
  const { parts, run, isLive } = file, words = [["run", run], ...(isLive ? [["live", "yes"]] : [])];
  const sizes = parts.map(part => part.bytes.length), names = parts.map(part => part.name.replace(/,/g, "_"));
  if (parts.length > 1) words.push(["sizes", sizes], ["names", names]);
  return { of: "open", words: asWords(words), body: joined(parts.map(part => part.bytes)) };
}

// Sets an option; of a choice also to a value that it does not list, as addresses may have.
function setOption(name, value) {
  const control = $("options").elements.namedItem(name);
  if (control?.options && ![...control.options].some(of => of.value === value)) control.add(new Option(value));
  if (control) control.value = value;
}

// Fills the editor with an example, or with a text of its own.
function edit(name, text) {
  const example = text === undefined ? EXAMPLES.find(example => example.name === name) ?? EXAMPLES[0] : undefined;
  state.example = example;
  if (example) $("options").reset();
  $("dag").value = text ?? example.text;
  // An app's functions are compiled into the page; there is nothing to edit.
  $("dag").readOnly = Boolean(example?.words.app);
  Object.entries(example?.words ?? {}).forEach(([name, value]) => setOption(name, value));
}

// Writes the state into the address, which opens the same in another browser.
async function writeAddress() {
  const { file, example, picked } = state, text = $("dag").value, words = file ? [] : options();
  if (!file && example?.text === text) words.push(["example", example.name]);
  else if (!file) {
    const bytes = await through(new CompressionStream("deflate-raw"), new TextEncoder().encode(text));
    const base64 = btoa(Array.from(bytes, byte => String.fromCharCode(byte)).join(""));
    words.push(["dag", base64.replace(/\+/g, "-").replace(/\//g, "_").replace(/=/g, "")]);
  }
  if (view.isChosen) words.push(["from", Math.round(view.from)], ["to", Math.round(view.to)]);
  if (picked) words.push(["job", `${picked.dag.name}.${picked.number}`]);
  history.replaceState(null, "", `#${new URLSearchParams(words)}`);
  $("link").textContent = "Copy link";
}

// Reads the state from the address.
async function readAddress() {
  const words = new URLSearchParams(location.hash.slice(1));
  edit(words.get("example"));
  Object.assign(view, { from: +words.get("from"), to: +words.get("to"), isChosen: words.has("to") });
  // Which job that is, only the answer tells.
  const [name, number] = words.get("job")?.split(/\.(?=\d+$)/) ?? [];
  state.picked = name && { dag: { name }, number: Number(number) };
  if (words.has("dag")) {
    const bytes = fromBase64(words.get("dag").replace(/-/g, "+").replace(/_/g, "/"));
    $("options").reset();
    const text = await through(new DecompressionStream("deflate-raw"), bytes, MOST_TEXT);
    edit(undefined, new TextDecoder().decode(text));
  }
  for (const [name, value] of words) setOption(name, value);
}
