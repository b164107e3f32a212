// Runs a unit of the firmware in MicroPython in real time, its datagrams as UDP. Arguments: the path of micropython.mjs.
// Standard input: JSON {files: {name: base64}, script: text, port: number}. The script defines `step()`, and finds the
// functions `send(hex)`, `receive()`, which returns hex or "", and `ticks_us()` in the module `outside`; the interpreter's
// own ticks are of 1 ms. Ends when standard input does.
import dgram from "node:dgram";
import readline from "node:readline";
import { pathToFileURL } from "node:url";

const { loadMicroPython } = await import(pathToFileURL(process.argv[2]).href);
const input = readline.createInterface({ input: process.stdin });
const { files, script, port } = await new Promise((resolve) => input.once("line", (line) => resolve(JSON.parse(line))));
input.on("close", () => process.exit(0));

const socket = dgram.createSocket("udp4");
const inbox = [];
socket.on("message", (datagram) => inbox.push(datagram.toString("hex")));
await new Promise((resolve) => socket.bind(0, "127.0.0.1", resolve));

const micropython = await loadMicroPython({ linebuffer: true });
for (const [name, content] of Object.entries(files)) {
  micropython.FS.writeFile("/" + name, Buffer.from(content, "base64"));
}
micropython.registerJsModule("outside", {
  send: (hex) => socket.send(Buffer.from(hex, "hex"), port, "127.0.0.1"),
  receive: () => inbox.shift() ?? "",
  ticks_us: () => Math.floor(1e3 * performance.now()) % 2 ** 30,
});

function or_die(run) {
  try {
    return run();
  } catch (error) {
    process.stderr.write(error.message);
    process.exit(1);
  }
}

or_die(() => micropython.runPython("import sys; sys.path.insert(0, '/')\n" + script));
const step = micropython.globals.get("step");
setInterval(() => or_die(step), 1);
