// cue_conform.mjs - the native receiver as WebAssembly, as a program for `cuecast conform`.
//
//     python -m receiver.native.build conform -o DIR
//     cuecast conform node cue_conform.mjs DIR/cue_conform.wasm
//
// The objects are those of the page's module; only the tool's input and output need WASI.
import { readFileSync } from "node:fs";
import { WASI } from "node:wasi";

const wasi = new WASI({ version: "preview1", preopens: { "/": "/" }, returnOnExit: true });
const module = await WebAssembly.compile(readFileSync(process.argv[2]));
const instance = await WebAssembly.instantiate(module, wasi.getImportObject());
process.exitCode = wasi.start(instance);
