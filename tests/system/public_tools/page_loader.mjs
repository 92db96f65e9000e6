// Loads modules of the console's page into Node.
import { mkdtemp, rm, writeFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

/** What these lines of TypeScript export, which name modules below `sources`; `libraries`: a folder with node_modules. */
export async function loadPage(sources, libraries, lines) {
  const require = createRequire(join(libraries, "package.json"));
  const built = await require("esbuild").build({
    stdin: { contents: lines.join("\n"), resolveDir: sources, loader: "ts" }, bundle: true, write: false, format: "esm", platform: "node", logLevel: "error",
    nodePaths: [join(libraries, "node_modules")], define: { TENON_PROTOCOL: "1" }, loader: { ".css": "empty" },
    banner: { js: 'import { createRequire } from "node:module"; const require = createRequire(import.meta.url);' },
  });
  const folder = await mkdtemp(join(tmpdir(), "page_"));
  try {
    const file = join(folder, "page.mjs");
    await writeFile(file, built.outputFiles[0].text);
    return await import(pathToFileURL(file).href);
  } finally {
    await rm(folder, { recursive: true });
  }
}

/** Runs tests by their names; ends the program with 1 when one fails. */
export async function runTests(tests) {
  let failed = 0;
  for (const [name, test] of Object.entries(tests)) {
    try {
      await test();
      console.log(`passed: ${name}`);
    } catch (problem) {
      ++failed;
      console.log(`failed: ${name}: ${problem.stack}`);
    }
  }
  process.exit(failed > 0 ? 1 : 0);
}
