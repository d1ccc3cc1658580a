// Unpacks this file and begins: styles, modules one after the other, the program.
(async () => {
  const signs = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%&()*+-;,=>?@^_`{|}~";
  const value = new Uint8Array(128);
  [...signs].forEach((sign, i) => (value[sign.charCodeAt(0)] = i));
  const packed = (/** @type {string} */ id) => {
    const text = /** @type {HTMLElement} */ (document.getElementById(id)).textContent ?? "";
    const bytes = new Uint8Array(4 * Math.ceil(text.length / 5));
    const view = new DataView(bytes.buffer);
    for (let at = 0; at < text.length; at += 5) {
      let number = 0;
      // What is missing at the end counts as the last sign.
      for (let i = at; i < at + 5; i++) number = 85 * number + (i < text.length ? value[text.charCodeAt(i)] : 84);
      view.setUint32((at / 5) * 4, number);
    }
    return bytes.subarray(0, Math.floor((text.length * 4) / 5));
  };
  const unpacked = (/** @type {string} */ id) =>
    new Response(new Blob([packed(id)]).stream().pipeThrough(new DecompressionStream("gzip")));
  // What is needed, in words, for browsers that do not understand this script, too.
  const opening = /** @type {HTMLElement} */ (document.getElementById("opening"));
  // A module with one instruction of SIMD: (i8x16.splat (i32.const 0)).
  const simd = Uint8Array.of(0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 8, 1, 6, 0, 65, 0, 253, 15, 11);
  /** @type {[string, () => boolean][]} */
  const needed = [
    ["WebAssembly", () => typeof WebAssembly === "object"],
    ["the SIMD instructions of WebAssembly", () => WebAssembly.validate(simd)],
    ["DecompressionStream", () => typeof DecompressionStream === "function"],
  ];
  try {
    for (const [what, has] of needed) if (!has()) throw new Error(`it lacks ${what}`);
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
    opening.remove();
    const panel = /** @type {HTMLElement} */ (document.getElementById("licences"));
    panel.querySelector("pre")?.append(licences);
    await import(places["main.js"]);
  } catch (error) {
    opening.setAttribute("role", "alert");
    opening.prepend(`This browser cannot open moiregauge: ${/** @type {Error} */ (error).message}. `);
  }
})();
