import { defineConfig } from "vite";

// files below /page/ have a hash of their content in their names; the gateway serves them as immutable
export default defineConfig({
  base: "/",
  define: { TENON_PROTOCOL: Number(process.env["TENON_PROTOCOL"]) },
  build: { assetsDir: "page", target: "es2022", modulePreload: { polyfill: false }, assetsInlineLimit: 0, chunkSizeWarningLimit: 1500 },
});
