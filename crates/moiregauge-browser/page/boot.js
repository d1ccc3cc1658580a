// Unpacks this file and begins: styles, modules one after the other, the program.
(async () => {
  const packed = (/** @type {string} */ id) => {
    const text = atob(/** @type {HTMLElement} */ (document.getElementById(id)).textContent ?? "");
    return Uint8Array.from(text, (c) => c.charCodeAt(0));
  };
  const unpacked = (/** @type {string} */ id) =>
    new Response(new Blob([packed(id)]).stream().pipeThrough(new DecompressionStream("gzip")));
  try {
    const { styles, modules, licences, icon } = await (await unpacked("page")).json();
    document.head.append(Object.assign(document.createElement("style"), { textContent: styles }));
    document.head.append(Object.assign(document.createElement("link"), { rel: "icon", href: `data:image/svg+xml,${encodeURIComponent(icon)}` }));
    /** @type {Record<string, string>} */
    const places = {};
    for (const [name, text] of modules) {
      // Modules come after those that they import, and name them by a mark.
      const code = text.replace(/"moiregauge:([\w.]+)"/g, (/** @type {string} */ _, /** @type {string} */ other) => JSON.stringify(places[other]));
      places[name] = URL.createObjectURL(new Blob([code], { type: "text/javascript" }));
    }
    const { Within } = await import(places["within.js"]);
    const program = await WebAssembly.compile(await (await unpacked("program")).arrayBuffer());
    Object.assign(globalThis, { moiregaugeWithin: new Within(program, places["worker.js"]) });
    for (const id of ["page", "program"]) document.getElementById(id)?.remove();
    const panel = /** @type {HTMLElement} */ (document.getElementById("licences"));
    panel.querySelector("pre")?.append(licences);
    await import(places["main.js"]);
  } catch (error) {
    document.body.append(`This browser cannot open the page: ${error}. It needs WebAssembly with SIMD and DecompressionStream.`);
  }
})();
