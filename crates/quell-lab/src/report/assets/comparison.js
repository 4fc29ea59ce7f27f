"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const byId = (id) => document.getElementById(id);
  const clamp = (v, low, high) => Math.min(Math.max(v, low), high);
  const { width, height, panels: sequences } = data;
  const frameCount = data.frames.length;
  const REFERENCE = sequences.findIndex((s) => s.name === "reference");
  const SERIES = 11;
  const order = [...new Set([...sequences.map((s) => s.name), ...data.methods.map((m) => m.name)])];
  const colourOf = (name) => `var(--series-${order.indexOf(name) % SERIES})`;
  const element = (tag, className, text) => {
    const e = document.createElement(tag);
    if (className) e.className = className;
    if (text !== undefined) e.textContent = text;
    return e;
  };
  const dot = (name) => {
    const e = element("i");
    e.style.background = colourOf(name);
    return e;
  };
  const methodOf = (name) => data.methods.find((m) => m.name === name);
  const textOf = (name, figure) => methodOf(name)?.texts[figure];

  // ---- What is shown. Everything on the page follows from this object. ----
  const firstMethod = Math.max(0, sequences.findIndex((s) => s.name !== "reference" && s.name !== "none"));
  const state = {
    mode: "grid", // grid | wipe | one | slice
    shown: sequences.map(() => true),
    single: firstMethod,
    wipeA: Math.max(0, sequences.findIndex((s) => s.name === "none")),
    wipeB: firstMethod,
    wipe: 0.5,
    row: data.slice_rows.length >> 1,
    frame: frameCount - 1,
    errors: false,
    zoom: 1, // 1: fits
    centre: [width / 2, height / 2],
    playing: false,
    speed: 1,
    figure: "hdr_flip",
  };

  // ---- Pictures ----
  const source = (base64) => `data:image/${base64.startsWith("/9j/") ? "jpeg" : "png"};base64,${base64}`;
  const images = new Map();
  const load = (key, base64) => {
    if (!base64) return null;
    let found = images.get(key);
    if (!found) {
      found = new Image();
      found.src = source(base64);
      found.decode().then(redraw, () => {});
      images.set(key, found);
    }
    return found.complete && found.naturalWidth ? found : null;
  };
  const image = (kind, s, f) => load(`${kind} ${s} ${f}`, sequences[s][kind][f]);
  // Anchors of the colour map magma (CC0), every eighth.
  const MAGMA = [[0, 0, 4], [28, 16, 68], [79, 18, 123], [129, 37, 129], [181, 54, 122], [229, 80, 100], [251, 135, 97], [254, 194, 135], [252, 253, 191]];
  const magma = (v) => {
    const at = clamp(v, 0, 1) * (MAGMA.length - 1);
    const i = Math.min(Math.floor(at), MAGMA.length - 2);
    return MAGMA[i].map((c, k) => Math.round(c + (MAGMA[i + 1][k] - c) * (at - i)));
  };
  const MAP = Array.from({ length: 256 }, (_, i) => magma(i / 255));
  const coloured = new Map();
  const errorMap = (s, f) => {
    const grey = image("errors", s, f);
    if (!grey) return null;
    const key = `${s} ${f}`;
    let canvas = coloured.get(key);
    if (!canvas) {
      canvas = document.createElement("canvas");
      canvas.width = width;
      canvas.height = height;
      const context = canvas.getContext("2d", { willReadFrequently: true });
      context.drawImage(grey, 0, 0);
      const pixels = context.getImageData(0, 0, width, height);
      const p = pixels.data;
      for (let i = 0; i < p.length; i += 4) {
        const c = MAP[p[i]];
        p[i] = c[0]; p[i + 1] = c[1]; p[i + 2] = c[2];
      }
      context.putImageData(pixels, 0, 0);
      coloured.set(key, canvas);
    }
    return canvas;
  };
  const hasErrors = sequences.some((s) => s.errors.some(Boolean));
  const hasSlices = data.slice_rows.length > 0 && sequences.some((s) => s.slices.length);

  // ---- Layout: which sequence stands where, in CSS pixels ----
  const viewer = byId("viewer");
  const canvas = byId("canvas");
  const context = canvas.getContext("2d");
  const GAP = 3; // between panels, CSS pixels
  const NARROWEST = 220; // a panel is never narrower, where there is room for one at all
  const SLICE_SHAPE = 0.56; // height over width of a slice's panel
  let panels = [];
  const layout = () => {
    const available = viewer.clientWidth;
    const tallest = Math.max(260, window.innerHeight * 0.78);
    const wanted = state.mode === "wipe" ? [state.wipeA] : state.mode === "one" ? [state.single]
      : sequences.map((_, i) => i).filter((i) => state.shown[i] && (state.mode === "grid" || sequences[i].slices.length));
    const shape = state.mode === "slice" ? SLICE_SHAPE : height / width;
    // As large as fits the window; where the panels would become too small, the page scrolls.
    let columns = 1;
    for (let c = 1; c <= wanted.length; c++) {
      const w = (available - GAP * (c - 1)) / c;
      if (c > 1 && w < NARROWEST) break;
      columns = c;
      if (Math.ceil(wanted.length / c) * (w * shape + GAP) <= tallest) break;
    }
    const ratio = window.devicePixelRatio || 1;
    let w = Math.floor((available - GAP * (columns - 1)) / columns);
    if (wanted.length === 1) w = Math.min(w, Math.floor(tallest / shape));
    const scale = (w * ratio) / width;
    // A little room is given up where that makes every pixel a whole number of the screen's.
    if (state.mode !== "slice" && scale >= 1 && Math.floor(scale) * 1.25 > scale) w = Math.floor((Math.floor(scale) * width) / ratio);
    const h = Math.round(w * shape);
    const rows = Math.ceil(wanted.length / columns);
    const margin = Math.max(0, Math.floor((available - w * columns - GAP * (columns - 1)) / 2));
    panels = wanted.map((s, i) => ({ s, x: margin + (i % columns) * (w + GAP), y: Math.floor(i / columns) * (h + GAP), w, h }));
    const total = Math.max(60, rows * h + Math.max(0, rows - 1) * GAP);
    const pixels = [Math.round(available * ratio), Math.round(total * ratio)];
    if (canvas.width !== pixels[0] || canvas.height !== pixels[1]) {
      [canvas.width, canvas.height] = pixels;
      canvas.style.width = `${available}px`;
      canvas.style.height = `${total}px`;
    }
  };
  const scaleOf = (panel) => Math.min(panel.w / width, panel.h / height) * state.zoom;
  const toImage = (panel, x, y) => {
    const scale = scaleOf(panel);
    return [state.centre[0] + (x - panel.x - panel.w / 2) / scale, state.centre[1] + (y - panel.y - panel.h / 2) / scale];
  };
  const panelAt = (x, y) => panels.find((p) => x >= p.x && x < p.x + p.w && y >= p.y && y < p.y + p.h);

  // ---- Drawing ----
  const SHARP_FROM = 2; // scale from which pixels are drawn as squares
  const isMap = (s) => state.errors && Boolean(sequences[s].errors[state.frame]);
  const drawPicture = (panel, s, left, right) => {
    const picture = isMap(s) ? errorMap(s, state.frame) : image("pictures", s, state.frame);
    if (!picture) return;
    const scale = scaleOf(panel);
    context.save();
    context.beginPath();
    context.rect(left, panel.y, right - left, panel.h);
    context.clip();
    context.imageSmoothingEnabled = scale * (window.devicePixelRatio || 1) < SHARP_FROM;
    context.imageSmoothingQuality = "high";
    context.drawImage(picture, panel.x + panel.w / 2 - state.centre[0] * scale, panel.y + panel.h / 2 - state.centre[1] * scale, width * scale, height * scale);
    context.restore();
  };
  const drawSlice = (panel) => {
    const slice = load(`slice ${panel.s} ${state.row}`, sequences[panel.s].slices[state.row]);
    if (!slice) return;
    context.imageSmoothingEnabled = false;
    context.drawImage(slice, panel.x, panel.y, panel.w, panel.h);
    const f = data.slice_frames.indexOf(data.frames[state.frame]);
    if (f < 0) return;
    const y = panel.y + ((f + 0.5) * panel.h) / data.slice_frames.length;
    context.fillStyle = "rgba(255,255,255,.9)";
    for (const [x, tip] of [[panel.x, 7], [panel.x + panel.w, -7]]) {
      context.beginPath();
      context.moveTo(x, y - 5); context.lineTo(x + tip, y); context.lineTo(x, y + 5);
      context.fill();
    }
  };
  const draw = () => {
    layout();
    const ratio = window.devicePixelRatio || 1;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    for (const panel of panels) {
      if (state.mode === "slice") drawSlice(panel);
      else if (state.mode === "wipe") {
        const middle = panel.x + panel.w * state.wipe;
        drawPicture(panel, state.wipeA, panel.x, middle);
        drawPicture(panel, state.wipeB, middle, panel.x + panel.w);
      } else drawPicture(panel, panel.s, panel.x, panel.x + panel.w);
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
  let overlayKey = "";
  const describe = () => {
    const overlay = byId("overlay");
    const key = JSON.stringify([panels, state.mode, state.frame, state.errors, state.wipeA, state.wipeB]);
    if (key !== overlayKey) {
      overlayKey = key;
      overlay.replaceChildren();
      const chip = (s, x, y, fromRight) => {
        const c = element("div", "chip");
        const { name, flip } = sequences[s];
        c.append(dot(name), name);
        const value = flip[state.frame];
        if (state.mode !== "slice" && value !== null && value !== undefined) c.append(element("small", "", `FLIP ${value.toFixed(3)}`));
        c.style.top = `${y + 8}px`;
        if (fromRight === undefined) c.style.left = `${x + 8}px`; else c.style.right = `${fromRight + 8}px`;
        overlay.append(c);
      };
      const absent = (panel, s) => {
        if (state.mode === "slice" || sequences[s].pictures[state.frame]) return;
        const box = element("div", "absent");
        Object.assign(box.style, { left: `${panel.x}px`, top: `${panel.y}px`, width: `${panel.w}px`, height: `${panel.h}px` });
        box.append(element("span", "", `no picture of frame ${data.frames[state.frame]}`));
        overlay.append(box);
      };
      for (const panel of panels) {
        if (state.mode === "wipe") {
          chip(state.wipeA, panel.x, panel.y);
          chip(state.wipeB, 0, panel.y, viewer.clientWidth - panel.x - panel.w);
        } else {
          chip(panel.s, panel.x, panel.y);
          absent(panel, panel.s);
        }
      }
    }
    const root = document.body;
    root.dataset.mode = state.mode;
    root.dataset.frame = data.frames[state.frame];
    root.dataset.errors = state.errors;
    root.dataset.panels = panels.length;
    root.dataset.zoom = (panels.length ? scaleOf(panels[0]) : 1).toFixed(3);
    root.classList.toggle("playing", state.playing);
    for (const mode of ["grid", "wipe", "one", "slice"]) byId(`mode-${mode}`).setAttribute("aria-pressed", state.mode === mode);
    for (const [i, button] of [...byId("chips").children].entries()) if (i < sequences.length) button.setAttribute("aria-pressed", state.shown[i]);
    byId("chips").hidden = state.mode !== "grid" && state.mode !== "slice";
    byId("wipe-choice").hidden = state.mode !== "wipe";
    byId("one-choice").hidden = state.mode !== "one";
    byId("slice-choice").hidden = state.mode !== "slice";
    byId("wipe-a").value = state.wipeA;
    byId("wipe-b").value = state.wipeB;
    byId("one-method").value = state.single;
    byId("slice-row").value = state.row;
    const divider = byId("divider");
    divider.hidden = state.mode !== "wipe";
    if (panels.length) {
      divider.style.left = `${panels[0].x + panels[0].w * state.wipe}px`;
    }
    divider.setAttribute("aria-valuenow", Math.round(state.wipe * 100));
    byId("errors").setAttribute("aria-pressed", state.errors);
    byId("legend").hidden = !state.errors || state.mode === "slice";
    byId("zoom-value").textContent = state.mode === "slice" || !panels.length ? "fit" : `${Math.round(scaleOf(panels[0]) * 100)} %`;
    const slider = byId("frame");
    slider.value = state.frame;
    slider.style.setProperty("--part", `${frameCount > 1 ? (state.frame / (frameCount - 1)) * 100 : 0}%`);
    slider.setAttribute("aria-valuetext", `frame ${data.frames[state.frame]}`);
    byId("count").replaceChildren("frame ", element("b", "", data.frames[state.frame]), ` \u00b7 ${state.frame + 1} of ${frameCount}`);
    byId("play").setAttribute("aria-label", state.playing ? "Pause" : "Play");
    const current = state.mode === "one" ? sequences[state.single].name : "";
    for (const row of document.querySelectorAll("#tables tbody tr")) row.classList.toggle("current", row.dataset.method === current);
    canvas.setAttribute("aria-label", `${state.errors ? "FLIP maps" : "Pictures"}, frame ${data.frames[state.frame]}: ${panels.map((p) => sequences[p.s].name).join(", ")}`);
  };

  const set = (change) => {
    Object.assign(state, change);
    state.frame = clamp(state.frame, 0, frameCount - 1);
    state.wipe = clamp(state.wipe, 0, 1);
    state.row = clamp(state.row, 0, Math.max(0, data.slice_rows.length - 1));
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
  const setMode = (mode) => { if (mode !== "slice" || hasSlices) set({ mode }); };
  const showOne = (i) => { if (i >= 0 && i < sequences.length) set({ mode: "one", single: i }); };
  const flipBy = (by) => {
    if (state.mode === "slice") set({ row: state.row + by });
    else showOne((state.single + by + sequences.length) % sequences.length);
  };

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
      if (panels.every((p) => !sequences[p.s].pictures[next] || image("pictures", p.s, next))) set({ frame: next });
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
  let hover = null;
  const readout = () => {
    const target = byId("readout");
    const panel = hover && panelAt(hover[0], hover[1]);
    const at = panel && state.mode !== "slice" ? toImage(panel, hover[0], hover[1]).map(Math.floor) : null;
    if (!at || at[0] < 0 || at[1] < 0 || at[0] >= width || at[1] >= height) {
      target.textContent = "Point at a picture to read its pixels; wheel to zoom, drag to move, all together.";
      return;
    }
    target.replaceChildren("pixel ", element("b", "", `${at[0]}, ${at[1]}`));
    for (const s of new Set([...(state.mode === "wipe" ? [state.wipeA, state.wipeB] : [panel.s]), REFERENCE])) {
      const picture = s >= 0 && image("pictures", s, state.frame);
      if (!picture) continue;
      probeContext.drawImage(picture, at[0], at[1], 1, 1, 0, 0, 1, 1);
      const [r, g, b] = probeContext.getImageData(0, 0, 1, 1).data;
      const swatch = element("i");
      swatch.style.background = `rgb(${r} ${g} ${b})`;
      let text = `${r} ${g} ${b}`;
      const grey = image("errors", s, state.frame);
      if (grey) {
        probeContext.drawImage(grey, at[0], at[1], 1, 1, 0, 0, 1, 1);
        text += `, FLIP ${(probeContext.getImageData(0, 0, 1, 1).data[0] / 255).toFixed(2)}`;
      }
      target.append(swatch, `${sequences[s].name} `, element("b", "", text));
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
    const panel = panels[0];
    if (state.mode !== "slice" && pointers.size === 1) {
      const scale = scaleOf(panel);
      set({ centre: [clamp(state.centre[0] - (now[0] - before[0]) / scale, 0, width), clamp(state.centre[1] - (now[1] - before[1]) / scale, 0, height)] });
    } else if (pointers.size === 2) {
      const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
      const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);
      zoomBy(distance(now, other) / Math.max(1, distance(before, other)), panelAt(...other) || panel, ...other);
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
    const [x, y] = local(event);
    const lines = event.deltaMode === 1 ? 16 : 1;
    zoomBy(Math.exp(-clamp(event.deltaY * lines, -240, 240) * 0.0022), panelAt(x, y), x, y);
  }, { passive: false });
  const divider = byId("divider");
  divider.addEventListener("pointerdown", (event) => { divider.setPointerCapture(event.pointerId); });
  divider.addEventListener("pointermove", (event) => {
    if (divider.hasPointerCapture(event.pointerId) && panels.length) set({ wipe: (local(event)[0] - panels[0].x) / panels[0].w });
  });
  divider.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -0.02, ArrowRight: 0.02, PageDown: -0.1, PageUp: 0.1, Home: -1, End: 1 }[event.key];
    if (by) { set({ wipe: state.wipe + by }); event.preventDefault(); event.stopPropagation(); }
  });

  // ---- Keys: one table, from which the help line is made ----
  const toggleErrors = () => { if (hasErrors) set({ errors: !state.errors }); };
  const KEYS = [
    { show: ["space"], keys: [" "], help: "play", act: toggle },
    { show: ["\u2190", "\u2192"], keys: ["ArrowRight"], help: "frame", act: () => step(1) },
    { keys: ["ArrowLeft"], act: () => step(-1) },
    { keys: ["Home"], act: () => set({ playing: false, frame: 0 }) },
    { keys: ["End"], act: () => set({ playing: false, frame: frameCount - 1 }) },
    { show: ["g"], keys: ["g"], help: "grid", act: () => setMode("grid") },
    { show: ["w"], keys: ["w"], help: "wipe", act: () => setMode("wipe") },
    { show: ["o"], keys: ["o"], help: "one", act: () => setMode("one") },
    ...(hasSlices ? [{ show: ["x"], keys: ["x"], help: "x\u2013t slices", act: () => setMode("slice") }] : []),
    ...sequences.slice(0, 9).map((s, i) => ({ keys: [`${i + 1}`], act: () => showOne(i) })),
    { show: [`1\u2013${Math.min(9, sequences.length)}`], keys: [], help: "flip between methods" },
    { show: ["[", "]"], keys: ["]"], help: "next method, next row", act: () => flipBy(1) },
    { keys: ["["], act: () => flipBy(-1) },
    ...(hasErrors ? [{ show: ["e"], keys: ["e"], help: "FLIP maps", act: toggleErrors }] : []),
    { show: ["+", "\u2212"], keys: ["+", "="], help: "zoom", act: () => zoomBy(Math.SQRT2) },
    { keys: ["-"], act: () => zoomBy(Math.SQRT1_2) },
    { show: ["f"], keys: ["f", "0"], help: "fit", act: fit },
    { keys: ["ArrowUp"], act: () => flipBy(-1) },
    { keys: ["ArrowDown"], act: () => flipBy(1) },
  ];
  // What the mouse has pressed does not keep the keyboard: space plays.
  document.addEventListener("click", (event) => { if (event.detail > 0) event.target.closest("button")?.blur(); });
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const target = event.target;
    if (target.matches("select")) return;
    if (target.matches("input[type=range]") && /^(Arrow|Home|End|Page)/.test(event.key)) return;
    // Space presses the button that the keyboard has reached; after a mouse click it still plays.
    if (event.key === " " && target.matches("button:focus-visible, tr:focus-visible")) return;
    // Up and down scroll the page unless the pictures have the focus.
    if (/^Arrow(Up|Down)$/.test(event.key) && target !== viewer) return;
    const found = KEYS.find((k) => k.keys.includes(event.key.length === 1 ? event.key.toLowerCase() : event.key));
    if (!found) return;
    event.preventDefault();
    found.act();
  });

  // ---- Build the page ----
  byId("title").textContent = data.title;
  byId("subtitle").textContent = data.subtitle;
  byId("version").textContent = data.version;
  byId("command").textContent = data.command;
  if (!data.command) byId("about").hidden = true;
  if (data.reduced) {
    byId("reduced").textContent = data.reduced;
    byId("reduced").hidden = false;
  }
  byId("help").append(...KEYS.filter((k) => k.show).map((k) => {
    const item = element("span");
    item.append(...k.show.map((key) => element("kbd", "", key)), k.help);
    return item;
  }));
  sequences.forEach((s, i) => {
    const button = element("button");
    button.type = "button";
    button.title = `Show or hide ${s.name}; double click: only it and the reference`;
    button.append(dot(s.name), s.name);
    button.addEventListener("click", () => set({ shown: state.shown.map((v, k) => (k === i ? !v : v)) }));
    button.addEventListener("dblclick", () => set({ shown: state.shown.map((_, k) => k === i || k === REFERENCE) }));
    byId("chips").append(button);
    for (const id of ["wipe-a", "wipe-b", "one-method"]) byId(id).append(new Option(s.name, i));
  });
  for (const m of data.methods.filter((m) => m.reason)) {
    const button = element("button");
    button.type = "button";
    button.disabled = true;
    button.title = m.reason;
    button.append(dot(m.name), m.name);
    byId("chips").append(button);
  }
  data.slice_rows.forEach((row, i) => byId("slice-row").append(new Option(row, i)));
  for (const mode of ["grid", "wipe", "one", "slice"]) byId(`mode-${mode}`).addEventListener("click", () => setMode(mode));
  byId("mode-slice").disabled = !hasSlices;
  byId("wipe-a").addEventListener("change", (e) => set({ wipeA: +e.target.value }));
  byId("wipe-b").addEventListener("change", (e) => set({ wipeB: +e.target.value }));
  byId("one-method").addEventListener("change", (e) => showOne(+e.target.value));
  byId("slice-row").addEventListener("change", (e) => set({ row: +e.target.value }));
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

  // ---- Tables ----
  const WAY = { lower: "lower is better", higher: "higher is better", one: "1 is right" };
  const figureList = data.groups.flatMap((g) => g.figures);
  const tableOf = (title, id, figures) => {
    const table = element("table");
    table.id = `table-${id}`;
    const head = element("tr");
    head.append(element("th", "", "method"));
    for (const figure of figures) {
      const cell = element("th", "", figure.label);
      cell.title = `${figure.meaning}; ${WAY[figure.better]}`;
      head.append(cell);
    }
    const body = element("tbody");
    for (const method of data.methods) {
      const row = element("tr");
      row.dataset.method = method.name;
      const name = element("td");
      name.append(dot(method.name), method.name);
      row.append(name);
      const at = sequences.findIndex((s) => s.name === method.name);
      if (method.reason && id !== "pictures") continue;
      if (method.reason) {
        row.className = "out";
        const why = element("td", "reason", method.reason);
        why.colSpan = figures.length;
        row.append(why);
      } else {
        for (const figure of figures) {
          const text = method.texts[figure.name];
          const cell = element("td", text === undefined ? "null" : figure.best.includes(method.name) ? "best" : "", text ?? "\u2013");
          if (text === undefined) cell.title = method.why[figure.name] ?? "not measured";
          const value = method.values[figure.name];
          if (id === "scorecard" && typeof value === "number") {
            const most = Math.max(...data.methods.map((m) => m.values[figure.name] ?? 0));
            cell.classList.add("heat");
            cell.style.setProperty("--part", `${most > 0 ? clamp(value / most, 0, 1) * 100 : 0}%`);
          }
          row.append(cell);
        }
        if (at >= 0) {
          row.tabIndex = 0;
          row.addEventListener("click", () => showOne(at));
          row.addEventListener("keydown", (e) => { if (e.key === "Enter" || e.key === " ") { e.preventDefault(); showOne(at); } });
        }
      }
      body.append(row);
    }
    const thead = element("thead");
    thead.append(head);
    table.append(thead, body);
    const scroll = element("div", "scroll");
    scroll.append(table);
    byId("tables").append(element("h3", "", title), scroll);
  };
  const group = (id) => data.groups.find((g) => g.id === id)?.figures ?? [];
  tableOf("Pictures and cost", "pictures", [...group("pictures"), ...group("cost")]);
  if (group("scorecard").length) tableOf("Artefacts: 0 is best", "scorecard", group("scorecard"));
  byId("missing").append(...data.missing.map(([reason, names]) => {
    const item = element("li");
    item.append(element("b", "", names), `: ${reason}`);
    return item;
  }));
  if (data.notes.length) {
    byId("notes").hidden = false;
    byId("notes").querySelector("ul").append(...data.notes.map((text) => element("li", "", text)));
  }

  // ---- Quality against time ----
  const SVG = document.querySelector("svg").namespaceURI;
  const svg = (tag, attributes, text) => {
    const e = document.createElementNS(SVG, tag);
    for (const [k, v] of Object.entries(attributes)) e.setAttribute(k, v);
    if (text !== undefined) e.textContent = text;
    return e;
  };
  const nice = (v) => (v >= 100 ? v.toFixed(0) : v >= 1 ? +v.toPrecision(3) : +v.toPrecision(2)).toString();
  const plot = () => {
    const figure = figureList.find((f) => f.name === state.figure) ?? figureList[0];
    const points = data.methods
      .map((m) => ({ name: m.name, x: m.values.milliseconds, y: m.values[figure.name], text: m.texts[figure.name] }))
      .filter((p) => p.x > 0 && typeof p.y === "number" && p.name !== "none");
    const box = { w: 1100, h: 400, left: 76, right: 150, top: 26, bottom: 50 };
    const root = svg("svg", { viewBox: `0 0 ${box.w} ${box.h}`, role: "img", "aria-label": `${figure.label} against time: ${points.map((p) => `${p.name} ${p.text} in ${nice(p.x)} ms`).join(", ")}` });
    byId("plot").replaceChildren(root);
    if (!points.length) {
      root.append(svg("text", { x: box.w / 2, y: box.h / 2, "text-anchor": "middle" }, "no method has both this figure and a time"));
      return;
    }
    const log = Math.log10;
    let [x0, x1] = [Math.min(...points.map((p) => log(p.x))), Math.max(...points.map((p) => log(p.x)))];
    if (x1 - x0 < 0.6) [x0, x1] = [(x0 + x1) / 2 - 0.4, (x0 + x1) / 2 + 0.4];
    [x0, x1] = [x0 - (x1 - x0) * 0.06, x1 + (x1 - x0) * 0.06];
    let [y0, y1] = [Math.min(...points.map((p) => p.y)), Math.max(...points.map((p) => p.y))];
    if (figure.better === "lower" && y0 > 0 && y0 < 0.6 * y1) y0 = 0;
    const room = (y1 - y0) * 0.12 || Math.abs(y1) * 0.1 || 1;
    [y0, y1] = [y0 === 0 ? 0 : y0 - room, y1 + room];
    const X = (v) => box.left + ((log(v) - x0) / (x1 - x0)) * (box.w - box.left - box.right);
    const Y = (v) => box.h - box.bottom - ((v - y0) / (y1 - y0)) * (box.h - box.top - box.bottom);
    const bottom = box.h - box.bottom;
    for (let d = Math.floor(x0); d <= Math.ceil(x1); d++) {
      for (const k of [1, 2, 5]) {
        const v = k * 10 ** d;
        if (log(v) < x0 || log(v) > x1) continue;
        root.append(svg("line", { class: "rule", x1: X(v), x2: X(v), y1: box.top, y2: bottom }));
        root.append(svg("text", { x: X(v), y: bottom + 18, "text-anchor": "middle" }, nice(v)));
      }
    }
    const raw = (y1 - y0) / 5;
    const unit = 10 ** Math.floor(log(raw));
    const stride = [1, 2, 5, 10].map((k) => k * unit).find((s) => s >= raw) ?? raw;
    for (let v = Math.ceil(y0 / stride) * stride; v <= y1 + 1e-12; v += stride) {
      root.append(svg("line", { class: "rule", x1: box.left, x2: box.w - box.right, y1: Y(v), y2: Y(v) }));
      root.append(svg("text", { x: box.left - 10, y: Y(v) + 4, "text-anchor": "end" }, +v.toPrecision(3)));
    }
    root.append(svg("line", { class: "axis", x1: box.left, x2: box.w - box.right, y1: bottom, y2: bottom }));
    root.append(svg("text", { class: "title", x: (box.left + box.w - box.right) / 2, y: box.h - 10, "text-anchor": "middle" }, "milliseconds a frame (logarithmic)"));
    root.append(svg("text", { class: "title", x: box.left, y: 14 }, `${figure.label}: ${figure.meaning}; ${WAY[figure.better]}`));
    // Methods than which none is both faster and better.
    const badness = (v) => ({ lower: v, higher: -v, one: Math.abs(v - 1) })[figure.better];
    const front = [...points].sort((a, b) => a.x - b.x).filter((p, _, all) => !all.some((q) => q !== p && q.x <= p.x && badness(q.y) <= badness(p.y) && (q.x < p.x || badness(q.y) < badness(p.y))));
    if (front.length > 1) root.append(svg("polyline", { class: "front", points: front.map((p) => `${X(p.x)},${Y(p.y)}`).join(" ") }));
    // Names keep clear of each other: pushed down, with a line back to the point.
    const placed = [...points].sort((a, b) => Y(a.y) - Y(b.y)).map((p) => ({ ...p, px: X(p.x), py: Y(p.y) }));
    const labels = [];
    for (const p of placed) {
      let y = p.py;
      const length = 7 * p.name.length + 60;
      for (const other of labels) {
        if (Math.abs(other.y - y) < 15 && p.px + 11 < other.x + other.length && other.x < p.px + 11 + length) y = other.y + 15;
      }
      labels.push({ x: p.px + 11, y, length });
      if (Math.abs(y - p.py) > 3) root.append(svg("line", { class: "leader", x1: p.px, y1: p.py, x2: p.px + 9, y2: y }));
      const circle = svg("circle", { cx: p.px, cy: p.py, r: 5.5, style: `fill: ${colourOf(p.name)}` });
      circle.append(svg("title", {}, `${p.name}: ${p.text}, ${nice(p.x)} ms`));
      root.append(circle);
      const label = svg("text", { class: "name", x: p.px + 11, y: y + 4 }, p.name);
      root.append(label);
    }
  };
  for (const figure of figureList.filter((f) => !["milliseconds", "time_ratio"].includes(f.name))) byId("plot-figure").append(new Option(figure.label, figure.name));
  if (!figureList.some((f) => f.name === state.figure)) state.figure = figureList[0]?.name;
  byId("plot-figure").value = state.figure;
  byId("plot-figure").addEventListener("change", (e) => { state.figure = e.target.value; plot(); });
  if (figureList.length) plot(); else byId("plots").hidden = true;

  new ResizeObserver(redraw).observe(viewer);
  window.addEventListener("resize", redraw);
  readout();
  draw();
  // All pictures are decoded in the background, so that playing does not stutter.
  const waiting = [];
  for (let f = 0; f < frameCount; f++) {
    for (let s = 0; s < sequences.length; s++) waiting.push([s, (state.frame + f) % frameCount]);
  }
  const loadNext = () => {
    const next = waiting.shift();
    if (!next) { document.body.dataset.ready = "true"; return; }
    image("pictures", ...next);
    const found = images.get(`pictures ${next.join(" ")}`);
    (found ? found.decode().catch(() => {}) : Promise.resolve()).then(loadNext);
  };
  loadNext();
})();
