// Runs the engine's wasm in node, by the page's own functions: requests on standard input, each with
// its length before it, answers likewise on standard output.
import { readFileSync, writeSync } from "node:fs";
import { createRequire } from "node:module";

const { answered } = createRequire(import.meta.url)("../engine.js");
const program = new WebAssembly.Module(readFileSync(process.argv[2]));
const requests = readFileSync(0);
for (let at = 0; at < requests.length;) {
  const length = requests.readUInt32LE(at);
  const request = new Uint8Array(requests.subarray(at + 4, at + 4 + length));
  const answer = answered(program, request);
  const size = Buffer.alloc(4);
  size.writeUInt32LE(answer.length);
  for (const part of [size, answer]) {
    for (let done = 0; done < part.length;) done += writeSync(1, part, done);
  }
  at += 4 + length;
}
