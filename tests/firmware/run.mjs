// Runs a script in MicroPython. Arguments: the path of micropython.mjs. Standard input: JSON {files: {name: base64},
// script: text}; the files lie in the root of the interpreter's file system. What the script prints goes to standard
// output; an exception that it does not catch goes to standard error, and the exit status is 1.
import fs from "node:fs";
import { pathToFileURL } from "node:url";

const { loadMicroPython } = await import(pathToFileURL(process.argv[2]).href);
const { files, script } = JSON.parse(fs.readFileSync(0, "utf8"));

const line = [];
function print(bytes) {
  for (const byte of bytes) {
    line.push(byte);
    if (byte === 10) fs.writeSync(1, Uint8Array.from(line.splice(0)));
  }
}

const micropython = await loadMicroPython({ stdout: print, linebuffer: false });
for (const [name, content] of Object.entries(files)) {
  micropython.FS.writeFile("/" + name, Buffer.from(content, "base64"));
}
try {
  micropython.runPython("import sys; sys.path.insert(0, '/')");
  micropython.runPython(script);
} catch (error) {
  if (error.name !== "PythonError") throw error;
  process.stderr.write(error.message);
  process.exitCode = error.type === "SystemExit" ? 0 : 1;
}
fs.writeSync(1, Uint8Array.from(line));
