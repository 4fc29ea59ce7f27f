"use strict";
// What the pages with moving pictures share: pictures, canvas, zoom, wipe, playback, keys. A page brings its own state,
// arrangement and tables: player.js, comparison.js.

const byId = (id) => document.getElementById(id);
const clamp = (v, low, high) => Math.min(Math.max(v, low), high);
const element = (tag, className, text) => {
  const e = document.createElement(tag);
  if (className) e.className = className;
  if (text !== undefined) e.textContent = text;
  return e;
};
const dot = (colour) => {
  const e = element("i");
  e.style.background = colour;
  return e;
};

// Anchors of the colour map magma (CC0), every eighth.
const MAGMA = [[0, 0, 4], [28, 16, 68], [79, 18, 123], [129, 37, 129], [181, 54, 122], [229, 80, 100], [251, 135, 97], [254, 194, 135], [252, 253, 191]];
const MAP = Array.from({ length: 256 }, (_, k) => {
  const at = (k / 255) * (MAGMA.length - 1);
  const i = Math.min(Math.floor(at), MAGMA.length - 2);
  return MAGMA[i].map((c, n) => Math.round(c + (MAGMA[i + 1][n] - c) * (at - i)));
});
const GAP = 3; // between panels, CSS pixels
const SHARP_FROM = 2; // scale from which pixels are drawn as squares

/**
 * The viewer of a page. `state` is what is shown: mode, errors, frame, row, wipe, wipeA, wipeB, zoom (1: fits), centre,
 * playing, speed; everything on the page follows from it. `page` says what differs from page to page:
 *   sequences        with `name`, and `pictures` and `errors` by frame
 *   modes            names of the arrangements, each with a button `mode-NAME`
 *   rows             how many rows the slice can show
 *   mapName          what an error map is called beside a pixel; mapsTitle: for the canvas
 *   hint             what the line under the pictures says without a pointer
 *   layout(w, ratio) where which sequence stands: {panels: [{s, x, y, w, h}], total: height}, CSS pixels
 *   picture(s)       what to draw of a sequence now: {picture, alpha}, or nothing
 *   drawSlice(panel)
 *   pointed(panel)   sequences whose pixels are read under the pointer
 *   needed()         sequences that playing waits for
 *   dragSlice(dy)    what dragging does in a slice
 *   hasNoLegend()    where error maps are not shown though asked for; absent: nowhere
 *   describe()       all else that follows from the state
 */
const makeViewer = (data, state, page) => {
  const { sequences } = page;
  const { width, height } = data;
  const frameCount = data.frames.length;
  const hasErrors = sequences.some((s) => s.errors.some(Boolean));

  // ---- Pictures ----
  const images = new Map();
  const load = (key, base64) => {
    if (!base64) return null;
    let found = images.get(key);
    if (!found) {
      found = new Image();
      found.src = `data:image/${base64.startsWith("/9j/") ? "jpeg" : "png"};base64,${base64}`;
      found.decode().then(redraw, () => {});
      images.set(key, found);
    }
    return found.complete && found.naturalWidth ? found : null;
  };
  const image = (kind, s, f) => load(`${kind} ${s} ${f}`, sequences[s][kind][f]);
  const coloured = new Map();
  const errorMap = (s, f) => {
    const grey = image("errors", s, f);
    if (!grey) return null;
    const key = `${s} ${f}`;
    let map = coloured.get(key);
    if (!map) {
      map = document.createElement("canvas");
      map.width = width;
      map.height = height;
      const context = map.getContext("2d", { willReadFrequently: true });
      context.drawImage(grey, 0, 0);
      const pixels = context.getImageData(0, 0, width, height);
      const p = pixels.data;
      for (let i = 0; i < p.length; i += 4) [p[i], p[i + 1], p[i + 2]] = MAP[p[i]];
      context.putImageData(pixels, 0, 0);
      coloured.set(key, map);
    }
    return map;
  };

  // ---- Layout ----
  const viewer = byId("viewer");
  const canvas = byId("canvas");
  const context = canvas.getContext("2d");
  let panels = [];
  const layout = () => {
    const available = viewer.clientWidth;
    const ratio = window.devicePixelRatio || 1;
    const found = page.layout(available, ratio);
    panels = found.panels;
    const wanted = [Math.round(available * ratio), Math.round(found.total * ratio)];
    if (canvas.width !== wanted[0] || canvas.height !== wanted[1]) {
      [canvas.width, canvas.height] = wanted;
      canvas.style.width = `${available}px`;
      canvas.style.height = `${found.total}px`;
    }
  };
  const scaleOf = (panel) => Math.min(panel.w / width, panel.h / height) * state.zoom;
  const toImage = (panel, x, y) => {
    const scale = scaleOf(panel);
    return [state.centre[0] + (x - panel.x - panel.w / 2) / scale, state.centre[1] + (y - panel.y - panel.h / 2) / scale];
  };
  const panelAt = (x, y) => panels.find((p) => x >= p.x && x < p.x + p.w && y >= p.y && y < p.y + p.h);

  // ---- Drawing ----
  const drawPicture = (panel, s, left, right) => {
    const { picture, alpha = 1 } = page.picture(s) ?? {};
    if (!picture) return;
    const scale = scaleOf(panel);
    context.save();
    context.beginPath();
    context.rect(left, panel.y, right - left, panel.h);
    context.clip();
    context.globalAlpha = alpha;
    context.imageSmoothingEnabled = scale * (window.devicePixelRatio || 1) < SHARP_FROM;
    context.imageSmoothingQuality = "high";
    context.drawImage(picture, panel.x + panel.w / 2 - state.centre[0] * scale, panel.y + panel.h / 2 - state.centre[1] * scale, width * scale, height * scale);
    context.restore();
  };
  const draw = () => {
    layout();
    const ratio = window.devicePixelRatio || 1;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    for (const panel of panels) {
      if (state.mode === "slice") {
        context.save();
        page.drawSlice(panel);
        context.restore();
      } else if (state.mode === "wipe") {
        const middle = panel.x + panel.w * state.wipe;
        drawPicture(panel, state.wipeA, panel.x, middle);
        drawPicture(panel, state.wipeB, middle, panel.x + panel.w);
      } else {
        drawPicture(panel, panel.s, panel.x, panel.x + panel.w);
      }
    }
    describe();
  };
  let pending = false;
  function redraw() {
    if (pending) return;
    pending = true;
    requestAnimationFrame(() => { pending = false; draw(); });
  }

  // ---- Everything beside the canvas ----
  const divider = byId("divider");
  const describe = () => {
    page.describe();
    const root = document.body;
    root.dataset.mode = state.mode;
    root.dataset.frame = data.frames[state.frame];
    root.dataset.errors = state.errors;
    root.dataset.panels = panels.length;
    root.dataset.zoom = (panels.length ? scaleOf(panels[0]) : 1).toFixed(3);
    root.classList.toggle("playing", state.playing);
    for (const mode of page.modes) byId(`mode-${mode}`).setAttribute("aria-pressed", state.mode === mode);
    byId("wipe-choice").hidden = state.mode !== "wipe";
    byId("slice-choice").hidden = state.mode !== "slice";
    byId("wipe-a").value = state.wipeA;
    byId("wipe-b").value = state.wipeB;
    byId("slice-row").value = state.row;
    divider.hidden = state.mode !== "wipe";
    if (panels.length) divider.style.left = `${panels[0].x + panels[0].w * state.wipe}px`;
    divider.setAttribute("aria-valuenow", Math.round(state.wipe * 100));
    byId("errors").setAttribute("aria-pressed", state.errors);
    byId("legend").hidden = !state.errors || page.hasNoLegend?.();
    byId("zoom-value").textContent = state.mode === "slice" || !panels.length ? "fit" : `${Math.round(scaleOf(panels[0]) * 100)} %`;
    const slider = byId("frame");
    slider.value = state.frame;
    slider.style.setProperty("--part", `${frameCount > 1 ? (state.frame / (frameCount - 1)) * 100 : 0}%`);
    slider.setAttribute("aria-valuetext", `frame ${data.frames[state.frame]}`);
    byId("count").replaceChildren("frame ", element("b", "", data.frames[state.frame]), ` \u00b7 ${state.frame + 1} of ${frameCount}`);
    byId("play").setAttribute("aria-label", state.playing ? "Pause" : "Play");
    canvas.setAttribute("aria-label", `${state.errors ? page.mapsTitle : "Pictures"}, frame ${data.frames[state.frame]}: ${panels.map((p) => sequences[p.s].name).join(", ")}`);
  };
  /** A name on a picture, at its left or, with `fromRight`, at its right edge. */
  const chip = (colour, texts, x, y, fromRight) => {
    const c = element("div", "chip");
    c.append(dot(colour), ...texts);
    c.style.top = `${y + 8}px`;
    if (fromRight === undefined) c.style.left = `${x + 8}px`; else c.style.right = `${fromRight + 8}px`;
    byId("overlay").append(c);
  };
  /** A box over a panel, for what is not there. */
  const absent = (panel, ...content) => {
    const box = element("div", "absent");
    Object.assign(box.style, { left: `${panel.x}px`, top: `${panel.y}px`, width: `${panel.w}px`, height: `${panel.h}px` });
    box.append(...content);
    byId("overlay").append(box);
  };

  const set = (change) => {
    Object.assign(state, change);
    state.frame = clamp(state.frame, 0, frameCount - 1);
    state.row = clamp(state.row, 0, Math.max(0, page.rows - 1));
    state.wipe = clamp(state.wipe, 0, 1);
    redraw();
    if ("frame" in change) readout();
  };
  const zoomBy = (factor, panel, x, y) => {
    const p = panel || panels[0];
    if (!p || state.mode === "slice") return;
    const fit = scaleOf(p) / state.zoom;
    const zoom = clamp(state.zoom * factor, Math.min(1, 1 / fit), 64 / fit);
    const at = panel ? toImage(panel, x, y) : state.centre;
    const part = state.zoom / zoom;
    // The point under the pointer stays where it is.
    const centre = [at[0] + (state.centre[0] - at[0]) * part, at[1] + (state.centre[1] - at[1]) * part];
    set({ zoom, centre: [clamp(centre[0], 0, width), clamp(centre[1], 0, height)] });
  };
  const fit = () => set({ zoom: 1, centre: [width / 2, height / 2] });
  const step = (by) => set({ playing: false, frame: (state.frame + by + frameCount) % frameCount });
  const toggleErrors = () => { if (hasErrors) set({ errors: !state.errors }); };

  // ---- Playback: nothing is skipped; a slow machine plays slowly ----
  let last = 0;
  let due = 0;
  const tick = (now) => {
    if (!state.playing) return;
    due += ((now - last) / 1000) * data.fps * state.speed;
    last = now;
    if (due >= 1) {
      due %= 1;
      const next = (state.frame + 1) % frameCount;
      if (page.needed().every((s) => !sequences[s].pictures[next] || image("pictures", s, next))) set({ frame: next });
    }
    requestAnimationFrame(tick);
  };
  const toggle = () => {
    set({ playing: !state.playing && frameCount > 1 });
    if (state.playing) {
      last = performance.now();
      due = 0;
      requestAnimationFrame(tick);
    }
  };

  // ---- Pixel values under the pointer ----
  const probe = document.createElement("canvas");
  probe.width = probe.height = 1;
  const probeContext = probe.getContext("2d", { willReadFrequently: true });
  const pixelOf = (picture, at) => {
    probeContext.drawImage(picture, at[0], at[1], 1, 1, 0, 0, 1, 1);
    return probeContext.getImageData(0, 0, 1, 1).data;
  };
  let hover = null;
  const readout = () => {
    const target = byId("readout");
    const panel = hover && panelAt(hover[0], hover[1]);
    const at = panel && state.mode !== "slice" ? toImage(panel, hover[0], hover[1]).map(Math.floor) : null;
    if (!at || at[0] < 0 || at[1] < 0 || at[0] >= width || at[1] >= height) {
      target.textContent = page.hint;
      return;
    }
    target.replaceChildren("pixel ", element("b", "", `${at[0]}, ${at[1]}`));
    for (const s of page.pointed(panel)) {
      const picture = image("pictures", s, state.frame);
      if (!picture) continue;
      const [r, g, b] = pixelOf(picture, at);
      const swatch = dot(`rgb(${r} ${g} ${b})`);
      const grey = image("errors", s, state.frame);
      const map = grey ? `, ${page.mapName} ${(pixelOf(grey, at)[0] / 255).toFixed(2)}` : "";
      target.append(swatch, `${sequences[s].name} `, element("b", "", `${r} ${g} ${b}${map}`));
    }
  };

  // ---- Pointer: drag to move, wheel and pinch to zoom ----
  const local = (event) => {
    const box = viewer.getBoundingClientRect();
    return [event.clientX - box.left - viewer.clientLeft, event.clientY - box.top - viewer.clientTop];
  };
  const pointers = new Map();
  viewer.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || event.target.closest("button, .divider")) return;
    viewer.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, local(event));
    viewer.classList.add("dragging");
  });
  viewer.addEventListener("pointermove", (event) => {
    const now = local(event);
    hover = now;
    readout();
    const before = pointers.get(event.pointerId);
    if (!before || !panels.length) return;
    if (state.mode === "slice") {
      page.dragSlice(now[1] - before[1]);
    } else if (pointers.size === 1) {
      const scale = scaleOf(panels[0]);
      set({ centre: [clamp(state.centre[0] - (now[0] - before[0]) / scale, 0, width), clamp(state.centre[1] - (now[1] - before[1]) / scale, 0, height)] });
    } else if (pointers.size === 2) {
      const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
      const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);
      zoomBy(distance(now, other) / Math.max(1, distance(before, other)), panelAt(...other) || panels[0], ...other);
    }
    pointers.set(event.pointerId, now);
  });
  const release = (event) => {
    pointers.delete(event.pointerId);
    if (pointers.size === 0) viewer.classList.remove("dragging");
  };
  viewer.addEventListener("pointerup", release);
  viewer.addEventListener("pointercancel", release);
  viewer.addEventListener("pointerleave", () => { hover = null; readout(); });
  viewer.addEventListener("dblclick", (event) => { if (!event.target.closest("button, .divider")) fit(); });
  viewer.addEventListener("wheel", (event) => {
    // With a modifier, or where nothing can be zoomed, the page scrolls as ever.
    if (state.mode === "slice" || event.shiftKey) return;
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 16 : 1;
    const [x, y] = local(event);
    zoomBy(Math.exp(-clamp(event.deltaY * lines, -240, 240) * 0.0022), panelAt(x, y), x, y);
  }, { passive: false });
  divider.addEventListener("pointerdown", (event) => { divider.setPointerCapture(event.pointerId); });
  divider.addEventListener("pointermove", (event) => {
    if (divider.hasPointerCapture(event.pointerId) && panels.length) set({ wipe: (local(event)[0] - panels[0].x) / panels[0].w });
  });
  divider.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -0.02, ArrowRight: 0.02, PageDown: -0.1, PageUp: 0.1, Home: -1, End: 1 }[event.key];
    if (by) { set({ wipe: state.wipe + by }); event.preventDefault(); event.stopPropagation(); }
  });

  /** Keys: one table, from which the help line is made. What every page has stands around the page's own. */
  const bindKeys = (own) => {
    const keys = [
      { show: ["space"], keys: [" "], help: "play", act: toggle },
      { show: ["\u2190", "\u2192"], keys: ["ArrowRight"], help: "frame", act: () => step(1) },
      { keys: ["ArrowLeft"], act: () => step(-1) },
      { keys: ["Home"], act: () => set({ playing: false, frame: 0 }) },
      { keys: ["End"], act: () => set({ playing: false, frame: frameCount - 1 }) },
      ...own,
      ...(hasErrors ? [{ show: ["e"], keys: ["e"], help: page.mapsTitle.replace(/^E/, "e"), act: toggleErrors }] : []),
      { show: ["+", "\u2212"], keys: ["+", "="], help: "zoom", act: () => zoomBy(Math.SQRT2) },
      { keys: ["-"], act: () => zoomBy(Math.SQRT1_2) },
      { show: ["f"], keys: ["f", "0"], help: "fit", act: fit },
    ];
    // What the mouse has pressed does not keep the keyboard: space plays.
    document.addEventListener("click", (event) => { if (event.detail > 0) event.target.closest("button")?.blur(); });
    document.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const target = event.target;
      if (target.matches("select")) return;
      if (target.matches("input[type=range]") && /^(Arrow|Home|End|Page)/.test(event.key)) return;
      // Space presses what the keyboard has reached.
      if (event.key === " " && target.matches("button:focus-visible, tr:focus-visible")) return;
      // Up and down scroll the page unless the pictures have the focus.
      if (/^Arrow(Up|Down)$/.test(event.key) && target !== viewer) return;
      const found = keys.find((k) => k.keys.includes(event.key.length === 1 ? event.key.toLowerCase() : event.key));
      if (!found) return;
      event.preventDefault();
      found.act();
    });
    byId("help").append(...keys.filter((k) => k.show).map((k) => {
      const item = element("span");
      item.append(...k.show.map((key) => element("kbd", "", key)), k.help);
      return item;
    }));
  };

  /** Fills what every page has, draws, and decodes all pictures in the background, so that playing does not stutter. */
  const start = () => {
    for (const id of ["title", "subtitle", "version", "command"]) byId(id).textContent = data[id];
    if (data.reduced) {
      byId("reduced").textContent = data.reduced;
      byId("reduced").hidden = false;
    }
    if (data.notes.length) {
      byId("notes").hidden = false;
      byId("notes").querySelector("ul").append(...data.notes.map((text) => element("li", "", text)));
    }
    for (const id of ["wipe-a", "wipe-b"]) byId(id).append(...sequences.map((s, i) => new Option(s.name, i)));
    byId("wipe-a").addEventListener("change", (e) => set({ wipeA: +e.target.value }));
    byId("wipe-b").addEventListener("change", (e) => set({ wipeB: +e.target.value }));
    byId("errors").addEventListener("click", toggleErrors);
    byId("errors").disabled = !hasErrors;
    byId("zoom-in").addEventListener("click", () => zoomBy(Math.SQRT2));
    byId("zoom-out").addEventListener("click", () => zoomBy(Math.SQRT1_2));
    byId("zoom-fit").addEventListener("click", fit);
    byId("play").addEventListener("click", toggle);
    byId("step-back").addEventListener("click", () => step(-1));
    byId("step-forward").addEventListener("click", () => step(1));
    for (const id of ["play", "step-back", "step-forward", "frame", "speed"]) byId(id).disabled = frameCount < 2;
    byId("frame").max = frameCount - 1;
    byId("frame").addEventListener("input", (e) => set({ playing: false, frame: +e.target.value }));
    byId("speed").addEventListener("change", (e) => set({ speed: +e.target.value }));
    byId("legend").querySelector("i").style.background = `linear-gradient(90deg, ${MAGMA.map((c) => `rgb(${c})`).join(",")})`;
    new ResizeObserver(redraw).observe(viewer);
    window.addEventListener("resize", redraw);
    readout();
    draw();
    const waiting = data.frames.flatMap((_, f) => sequences.map((_, s) => [s, (state.frame + f) % frameCount]));
    const loadNext = () => {
      const next = waiting.shift();
      if (!next) { document.body.dataset.ready = "true"; return; }
      image("pictures", ...next);
      const found = images.get(`pictures ${next.join(" ")}`);
      (found ? found.decode().catch(() => {}) : Promise.resolve()).then(loadNext);
    };
    loadNext();
  };

  return { absent, bindKeys, chip, context, errorMap, image, load, panels: () => panels, set, start };
};
