// Unpacks this file and begins: styles, modules one after the other, the program.
(async () => {
  // Eleven signs hold nine bytes: all that are printed, but for "<".
  const packed = (/** @type {string} */ id) => {
    const element = /** @type {HTMLElement} */ (document.getElementById(id));
    const text = element.textContent ?? "";
    const bytes = new Uint8Array((text.length / 11) * 9);
    for (let at = 0, to = 0; at < text.length; at += 11) {
      // A number of 72 bits, in three parts.
      let high = 0, middle = 0, low = 0;
      for (let i = at; i < at + 11; i++) {
        const sign = text.charCodeAt(i);
        low = low * 94 + sign - (sign > 60 ? 33 : 32);
        middle = middle * 94 + (low >>> 24);
        high = high * 94 + (middle >>> 24);
        low &= 0xffffff;
        middle &= 0xffffff;
      }
      for (const part of [high, middle, low]) for (const shift of [16, 8, 0]) bytes[to++] = part >>> shift;
    }
    return bytes.subarray(0, Number(element.dataset.bytes));
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
