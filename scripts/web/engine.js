"use strict";
// The engine: a program of wasm that reads a request and writes an answer, and the worker that runs it.
//
// The program keeps nothing from request to request: each has an instance of its own. A request is a
// line of words and a file; an answer is a head in JSON, and columns of numbers (scripts/web/src).

function joined(parts) {
  const all = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  parts.reduce((at, part) => { all.set(part, at); return at + part.length; }, 0);
  return all;
}

// Runs the program with `input` on its standard input, and returns its output. These functions are all
// of WASI that it needs. The worker has them as text, so they name nothing of the page.
function answered(program, input) {
  let memory, taken = 0;
  const output = [], complaints = [];
  const put = (place, number) => { new DataView(memory.buffer).setUint32(place, number, true); return 0; };
  // One of several buffers is enough: a program asks again for the rest.
  const buffer = list => new Uint8Array(memory.buffer, ...new Uint32Array(memory.buffer, list, 2));
  const wasi_snapshot_preview1 = {
    environ_get: () => 0,
    environ_sizes_get: (count, size) => put(count, 0) || put(size, 0),
    sched_yield: () => 0,
    proc_exit: code => { throw { code }; },
    fd_read(_file, list, _count, size) {
      const part = input.subarray(taken, taken + buffer(list).length);
      buffer(list).set(part);
      taken += part.length;
      return put(size, part.length);
    },
    fd_write(file, list, _count, size) {
      (file === 1 ? output : complaints).push(buffer(list).slice());
      return put(size, buffer(list).length);
    },
  };
  const { exports } = new WebAssembly.Instance(program, { wasi_snapshot_preview1 });
  memory = exports.memory;
  try {
    exports._start();
  } catch (end) {
    if (end.code !== 0) throw new Error(new TextDecoder().decode(joined(complaints)) || end.message);
  }
  return joined(output);
}

// Reads an answer: its head, with the columns as arrays under their names.
function read(bytes) {
  const length = new DataView(bytes.buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
  const types = { Float64Array, Uint32Array, Uint8Array };
  for (const { name, type, from, count } of head.columns ?? []) {
    head[name] = new types[type](bytes.buffer, 4 + length + from, count);
  }
  return head;
}

// `requests`: those without an answer, the one that the worker is at first.
const engine = { program: undefined, isSync: false, worker: undefined, requests: [], limit: undefined };

const fromBase64 = text => Uint8Array.fromBase64?.(text) ?? Uint8Array.from(atob(text), c => c.charCodeAt(0));

// Compresses or expands, to so many bytes at most. Where all is there at once that needs no turn of the
// browser's loop.
async function through(stream, bytes, most = Infinity) {
  const writer = stream.writable.getWriter(), reader = stream.readable.getReader(), parts = [];
  Promise.all([writer.write(bytes), writer.close()]).catch(() => "the reader is told, too");
  for (let part = await reader.read(); !part.done; part = await reader.read()) {
    parts.push(part.value);
    if ((most -= part.value.length) < 0) throw new RangeError("too long");
  }
  return joined(parts);
}

// With `isSync` answers come before the page counts as loaded, so that a browser shows them to a test
// without a driver (`--headless --dump-dom`).
async function startEngine(base64, isSync) {
  const bytes = await through(new DecompressionStream("gzip"), fromBase64(base64));
  Object.assign(engine, { program: new WebAssembly.Module(bytes), isSync });
  startWorker();
}

// Starts a worker; what runs in one ends only with it.
function startWorker() {
  if (engine.isSync) return;
  engine.worker?.terminate();
  // A page that is a file has no other file to load a worker from.
  const source = `${joined}\n${answered}\nlet program;
    onmessage = ({ data }) => {
      if (data instanceof WebAssembly.Module) { program = data; return; }
      const bytes = answered(program, data);
      postMessage({ bytes }, [bytes.buffer]);
    };`;
  engine.worker = new Worker(URL.createObjectURL(new Blob([source], { type: "text/javascript" })));
  engine.worker.onmessage = ({ data }) => finishRequest(data);
  const fault = "The engine failed, which is a fault of this page";
  engine.worker.onerror = ({ message }) => finishRequest({ error: `${fault}: ${message}` });
  engine.worker.postMessage(engine.program);
}

// Asks for an answer. A request that `replaces` ends those before it, which then get none.
function ask(line, body, replaces = true) {
  if (replaces && engine.requests.length) {
    engine.requests = [];
    startWorker();
  }
  const input = joined([new TextEncoder().encode(`${line}\n`), body]);
  return new Promise(resolve => { if (engine.requests.push({ input, resolve }) === 1) beginRequest(); });
}

function beginRequest() {
  const [request] = engine.requests;
  clearTimeout(engine.limit);
  if (!request) return;
  request.begun = performance.now();
  if (engine.isSync) return finishRequest({ bytes: answered(engine.program, request.input) });
  engine.limit = setTimeout(() => {
    startWorker();
    finishRequest({ error: "This takes longer than 20 s here; ask for fewer periods, or a shorter run." });
  }, 20_000);
  engine.worker.postMessage(request.input, [request.input.buffer]);
}

function finishRequest(answer) {
  const { begun, resolve } = engine.requests.shift();
  resolve({ ...answer, ms: performance.now() - begun });
  beginRequest();
}

// The tests run the same functions in node.
if (typeof module !== "undefined") module.exports = { answered };
