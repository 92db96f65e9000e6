import { readdirSync, readFileSync } from "node:fs";
import { defineConfig, type Plugin } from "vite";

const LIBRARIES = ["three", "uplot", "@foxglove/omgidl-parser", "@foxglove/omgidl-serialization", "@mcap/core", "fzstd", "heap-js", "tslib"];

function licences(): string {
  return LIBRARIES.map((library) => {
    const folder = `node_modules/${library}`;
    const file = readdirSync(folder).find((name) => name.toUpperCase().startsWith("LICENSE"));
    return file === undefined ? "" : `${library}\n\n${readFileSync(`${folder}/${file}`, "utf-8")}\n\n`;
  }).join("");
}

/** Puts all into report.html, so that it opens as a file; nothing that stands in it ends its block. */
function oneFile(): Plugin {
  return {
    name: "one-file",
    enforce: "post",
    generateBundle(_, bundle) {
      let [script, style] = ["", ""];
      for (const [name, file] of Object.entries(bundle)) {
        if (file.type === "chunk") script += file.code;
        else if (name.endsWith(".css")) style += String(file.source);
        else this.error(`${name}: cannot be inside report.html`);
        delete bundle[name];
      }
      const parts = { style: style.replace(/<\/style/gi, "<\\/style"), licences: licences().replace(/</g, "&lt;"), script: script.replace(/<\/(script)/gi, "<\\/$1").replace(/<!--/g, "<\\!--") };
      const page = readFileSync("report.html", "utf-8").replace(/\/\* (\w+) \*\//g, (_, part: keyof typeof parts) => parts[part]);
      this.emitFile({ type: "asset", fileName: "report.html", source: page });
    },
  };
}

// the page of reports: clients/report puts a session into it
export default defineConfig({
  publicDir: false,
  plugins: [oneFile()],
  build: {
    target: "es2022", modulePreload: false, assetsInlineLimit: 1e8, chunkSizeWarningLimit: 1500, cssCodeSplit: false,
    rollupOptions: { input: "src/report/main.ts", output: { format: "iife", inlineDynamicImports: true, entryFileNames: "report.js" } },
  },
});
