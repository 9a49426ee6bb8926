// @ts-check
// A small server for static/ and the example: `node tests/static/serve.mjs [port]`, then open /example/?role=parent.

import { createReadStream, existsSync, statSync } from "node:fs";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";

const ROOT = fileURLToPath(new URL("../..", import.meta.url));
/** @type {Record<string, string>} */
const FOLDERS = {
  static: join(ROOT, "static"),
  example: join(ROOT, "tests/static/example"),
  benchmarks: join(ROOT, "benchmarks/browser"),
};
/** @type {Record<string, string>} */
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".json": "application/json" };

/** @param {string} path of the request */
function fileFor(path) {
  const [, folder = "", ...rest] = normalize(decodeURIComponent(path)).split("/");
  const base = FOLDERS[folder];
  if (!base) return null;
  const file = join(base, rest.join("/") || "index.html");
  return existsSync(file) && statSync(file).isFile() ? file : null;
}

/** @param {number} port 0: any free one */
export function serve(port = 0) {
  const server = createServer((request, response) => {
    const file = fileFor(new URL(request.url ?? "/", "http://localhost").pathname);
    if (!file) return void response.writeHead(404).end();
    response.writeHead(200, { "content-type": `${TYPES[extname(file)] ?? "text/plain"}; charset=utf-8` });
    createReadStream(file).pipe(response);
  });
  return new Promise((resolve) => {
    server.listen(port, "127.0.0.1", () => {
      const address = /** @type {import("node:net").AddressInfo} */ (server.address());
      resolve({ url: `http://127.0.0.1:${address.port}`, close: () => server.close() });
    });
  });
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const { url } = await serve(Number(process.argv[2] ?? 8137));
  console.log(`${url}/example/?role=parent (or child, driver)`);
}
