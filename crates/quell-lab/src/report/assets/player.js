"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const byId = (id) => document.getElementById(id);
  const colourOf = (i) => `var(--series-${i % 4})`;
  const clamp = (v, low, high) => Math.min(Math.max(v, low), high);
  const sequences = data.sequences;
  const frameCount = data.frames.length;
  const { width, height } = data;

  // ---- What is shown. Everything on the page follows from this object. ----
  const state = {
    mode: "side", // side | wipe | one | slice
    single: Math.min(1, sequences.length - 1),
    wipeA: 0,
    wipeB: Math.min(1, sequences.length - 1),
    wipe: 0.5,
    row: Math.floor(height / 2),
    frame: frameCount - 1,
    errors: false,
    zoom: 1, // 1: fits
    centre: [width / 2, height / 2],
    playing: false,
    speed: 1,
  };
  const complete = (f) => sequences.every((s) => s.pictures[f]);
  for (let f = frameCount - 1; f >= 0; f--) {
    if (complete(f)) { state.frame = f; break; }
  }

  // ---- Pictures ----
  const png = (base64) => `data:image/png;base64,${base64}`;
  const images = new Map();
  const image = (kind, s, f) => {
    const source = sequences[s][kind][f];
    if (!source) return null;
    const key = `${kind} ${s} ${f}`;
    let found = images.get(key);
    if (!found) {
      found = new Image();
      found.src = png(source);
      found.decode().then(redraw, () => {});
      images.set(key, found);
    }
    return found.complete && found.naturalWidth ? found : null;
  };
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
  const isReference = (s) => !sequences[s].errors.some(Boolean) && sequences[s].name.startsWith("reference");
  const nearest = (s, f) => {
    for (let d = 0; d < frameCount; d++) {
      for (const g of [f - d, f + d]) if (sequences[s].pictures[g]) return g;
    }
    return -1;
  };

  // ---- Layout: which sequence stands where, in CSS pixels ----
  const viewer = byId("viewer");
  const canvas = byId("canvas");
  const context = canvas.getContext("2d");
  const GAP = 3; // between panels, CSS pixels
  const SNAP = 1.3; // up to this factor smaller, for whole screen pixels
  let panels = [];
  const layout = () => {
    const available = viewer.clientWidth;
    const tallest = Math.max(200, window.innerHeight * 0.7);
    const shown = state.mode === "side" || state.mode === "slice" ? sequences.map((_, i) => i)
      : state.mode === "wipe" ? [state.wipeA] : [state.single];
    const columns = available < 720 ? 1 : shown.length;
    const rows = Math.ceil(shown.length / columns);
    const ratioOfPixels = window.devicePixelRatio || 1;
    let panelWidth = Math.floor((available - GAP * (columns - 1)) / columns);
    const ratio = state.mode === "slice" ? Math.max(height / width, 0.5) : height / width;
    let panelHeight = Math.min(panelWidth * ratio, rows > 1 ? Infinity : tallest);
    // A little room is given up where that makes every pixel a whole number of the screen's.
    const scale = Math.min(panelWidth / width, panelHeight / (width * ratio)) * ratioOfPixels;
    if (scale >= 1 && Math.floor(scale) * SNAP > scale) {
      panelHeight = (Math.floor(scale) * width * ratio) / ratioOfPixels;
      if (columns > 1) panelWidth = Math.floor((Math.floor(scale) * width) / ratioOfPixels);
    }
    panelHeight = Math.round(panelHeight);
    const margin = Math.floor((available - panelWidth * columns - GAP * (columns - 1)) / 2);
    panels = shown.map((s, i) => ({
      s,
      x: margin + (i % columns) * (panelWidth + GAP),
      y: Math.floor(i / columns) * (panelHeight + GAP),
      w: panelWidth,
      h: panelHeight,
    }));
    const total = rows * panelHeight + (rows - 1) * GAP;
    const wanted = [Math.round(available * ratioOfPixels), Math.round(total * ratioOfPixels)];
    if (canvas.width !== wanted[0] || canvas.height !== wanted[1]) {
      [canvas.width, canvas.height] = wanted;
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
  const drawPicture = (panel, s, left, right) => {
    const f = state.frame;
    const map = state.errors && !isReference(s) ? errorMap(s, f) : null;
    let picture = map || image("pictures", s, f);
    let alpha = state.errors && !isReference(s) && !map ? 0.3 : 1;
    if (!sequences[s].pictures[f]) {
      const other = nearest(s, f);
      picture = other >= 0 ? image("pictures", s, other) : null;
      alpha = 0.28;
    }
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
  const drawSlice = (panel) => {
    const rows = Math.max(1, Math.floor(panel.h / frameCount));
    const scaleX = panel.w / width;
    context.save();
    context.beginPath();
    context.rect(panel.x, panel.y, panel.w, panel.h);
    context.clip();
    context.imageSmoothingEnabled = false;
    for (let f = 0; f < frameCount; f++) {
      const top = panel.y + Math.round((f * panel.h) / frameCount);
      const bottom = panel.y + Math.round(((f + 1) * panel.h) / frameCount);
      const map = state.errors && !isReference(panel.s) ? errorMap(panel.s, f) : null;
      const picture = map || (state.errors && !isReference(panel.s) ? null : image("pictures", panel.s, f));
      if (picture) context.drawImage(picture, 0, state.row, width, 1, panel.x, top, width * scaleX, Math.max(bottom - top, rows));
    }
    const y = panel.y + ((state.frame + 0.5) * panel.h) / frameCount;
    context.fillStyle = "rgba(255,255,255,.85)";
    context.beginPath();
    context.moveTo(panel.x, y - 5); context.lineTo(panel.x + 7, y); context.lineTo(panel.x, y + 5);
    context.fill();
    context.restore();
  };
  const draw = () => {
    layout();
    const ratio = window.devicePixelRatio || 1;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    for (const panel of panels) {
      if (state.mode === "slice") { drawSlice(panel); continue; }
      if (state.mode === "wipe") {
        const middle = panel.x + panel.w * state.wipe;
        drawPicture(panel, state.wipeA, panel.x, middle);
        drawPicture(panel, state.wipeB, middle, panel.x + panel.w);
        continue;
      }
      drawPicture(panel, panel.s, panel.x, panel.x + panel.w);
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
  const element = (tag, className, text) => {
    const e = document.createElement(tag);
    if (className) e.className = className;
    if (text !== undefined) e.textContent = text;
    return e;
  };
  const dot = (i) => {
    const e = element("i");
    e.style.background = colourOf(i);
    return e;
  };
  let overlayKey = "";
  const describe = () => {
    const overlay = byId("overlay");
    const key = JSON.stringify([panels, state.mode, state.frame, state.errors, state.wipeA, state.wipeB, state.playing, state.mode === "slice" ? state.row : 0]);
    if (key !== overlayKey) {
      overlayKey = key;
      overlay.replaceChildren();
      const chip = (s, x, y, fromRight) => {
        const c = element("div", "chip");
        c.append(dot(s), sequences[s].name);
        if (state.mode === "slice") c.append(element("small", "", `row ${state.row}, time runs down`));
        else if (state.errors && !isReference(s) && sequences[s].errors[state.frame]) c.append(element("small", "", "error map"));
        c.style.top = `${y + 10}px`;
        if (fromRight === undefined) c.style.left = `${x + 10}px`; else c.style.right = `${fromRight + 10}px`;
        overlay.append(c);
      };
      const absent = (panel, s) => {
        const f = state.frame;
        const needsReference = state.errors && !isReference(s) && !sequences[s].errors[f];
        if (state.mode === "slice" || (sequences[s].pictures[f] && !needsReference)) return;
        const list = needsReference ? sequences[s].errors : sequences[s].pictures;
        const others = data.frames.filter((_, g) => list[g]);
        const box = element("div", "absent");
        Object.assign(box.style, { left: `${panel.x}px`, top: `${panel.y}px`, width: `${panel.w}px`, height: `${panel.h}px` });
        if (others.length === 0) {
          box.append(element("span", "", "no reference, so no error map"));
        } else {
          let target = 0;
          for (let d = 0; d < frameCount; d++) {
            const g = [state.frame - d, state.frame + d].find((g) => list[g]);
            if (g !== undefined) { target = g; break; }
          }
          if (state.playing) return;
          box.append(element("span", "", `no reference for frame ${data.frames[f]}`));
          const jump = element("button", "", `go to frame ${data.frames[target]}`);
          jump.type = "button";
          jump.addEventListener("click", () => set({ frame: target }));
          box.append(jump);
        }
        overlay.append(box);
      };
      for (const panel of panels) {
        if (state.mode === "wipe") {
          chip(state.wipeA, panel.x, panel.y);
          chip(state.wipeB, 0, panel.y, viewer.clientWidth - panel.x - panel.w);
          absent(panel, sequences[state.wipeA].pictures[state.frame] ? state.wipeB : state.wipeA);
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
    root.dataset.zoom = (panels.length ? scaleOf(panels[0]) : 1).toFixed(3);
    root.classList.toggle("playing", state.playing);
    for (const mode of ["side", "wipe", "slice"]) byId(`mode-${mode}`).setAttribute("aria-pressed", state.mode === mode);
    for (const [i, button] of [...byId("singles").children].entries()) button.setAttribute("aria-pressed", state.mode === "one" && state.single === i);
    byId("wipe-choice").hidden = state.mode !== "wipe";
    byId("slice-choice").hidden = state.mode !== "slice";
    byId("slice-value").textContent = state.row;
    byId("wipe-a").value = state.wipeA;
    byId("wipe-b").value = state.wipeB;
    const divider = byId("divider");
    divider.hidden = state.mode !== "wipe";
    divider.style.left = `${state.wipe * 100}%`;
    divider.setAttribute("aria-valuenow", Math.round(state.wipe * 100));
    byId("errors").setAttribute("aria-pressed", state.errors);
    byId("legend").hidden = !state.errors;
    byId("zoom-value").textContent = state.mode === "slice" ? "fit" : `${Math.round(scaleOf(panels[0]) * 100)} %`;
    const slider = byId("frame");
    slider.value = state.frame;
    slider.style.setProperty("--part", `${frameCount > 1 ? (state.frame / (frameCount - 1)) * 100 : 0}%`);
    slider.setAttribute("aria-valuetext", `frame ${data.frames[state.frame]}`);
    const row = byId("slice-row");
    row.value = state.row;
    row.style.setProperty("--part", `${(state.row / Math.max(1, height - 1)) * 100}%`);
    const count = byId("count");
    count.replaceChildren("frame ", element("b", "", data.frames[state.frame]), ` \u00b7 ${state.frame + 1} of ${frameCount}`);
    byId("play").setAttribute("aria-label", state.playing ? "Pause" : "Play");
    canvas.setAttribute("aria-label", `${state.errors ? "Error maps" : "Pictures"}, frame ${data.frames[state.frame]}: ${panels.map((p) => sequences[p.s].name).join(", ")}`);
  };

  const set = (change) => {
    Object.assign(state, change);
    state.frame = clamp(state.frame, 0, frameCount - 1);
    state.row = clamp(state.row, 0, height - 1);
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
  const setMode = (mode) => set({ mode });

  // ---- Playback ----
  let last = 0;
  let due = 0;
  const tick = (now) => {
    if (!state.playing) return;
    due += ((now - last) / 1000) * data.fps * state.speed;
    last = now;
    const whole = Math.floor(due);
    if (whole > 0) {
      due -= whole;
      // Skips nothing: a slow machine plays slowly rather than dropping frames.
      const next = (state.frame + 1) % frameCount;
      const ready = sequences.every((_, s) => !sequences[s].pictures[next] || image("pictures", s, next));
      if (ready) set({ frame: next });
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
      target.textContent = "Point at a picture to read its pixels; wheel to zoom, drag to move.";
      return;
    }
    target.replaceChildren("pixel ", element("b", "", `${at[0]}, ${at[1]}`));
    for (let s = 0; s < sequences.length; s++) {
      const picture = image("pictures", s, state.frame);
      if (!picture) continue;
      probeContext.drawImage(picture, at[0], at[1], 1, 1, 0, 0, 1, 1);
      const [r, g, b] = probeContext.getImageData(0, 0, 1, 1).data;
      const swatch = element("i");
      swatch.style.background = `rgb(${r} ${g} ${b})`;
      let text = `${r} ${g} ${b}`;
      const grey = image("errors", s, state.frame);
      if (grey) {
        probeContext.drawImage(grey, at[0], at[1], 1, 1, 0, 0, 1, 1);
        text += `, error ${(probeContext.getImageData(0, 0, 1, 1).data[0] / 255).toFixed(2)}`;
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
    if (!before) return;
    const panel = panels[0];
    if (state.mode === "slice") {
      set({ row: state.row + Math.sign(Math.round(now[1] - before[1])) });
    } else if (pointers.size === 1) {
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
    event.preventDefault();
    const [x, y] = local(event);
    const lines = event.deltaMode === 1 ? 16 : 1;
    zoomBy(Math.exp(-clamp(event.deltaY * lines, -240, 240) * 0.0022), panelAt(x, y), x, y);
  }, { passive: false });

  const divider = byId("divider");
  divider.addEventListener("pointerdown", (event) => { divider.setPointerCapture(event.pointerId); });
  divider.addEventListener("pointermove", (event) => {
    if (divider.hasPointerCapture(event.pointerId)) set({ wipe: local(event)[0] / viewer.clientWidth });
  });
  divider.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -0.02, ArrowRight: 0.02, PageDown: -0.1, PageUp: 0.1 }[event.key];
    if (by) { set({ wipe: state.wipe + by }); event.preventDefault(); event.stopPropagation(); }
    if (event.key === "Home" || event.key === "End") { set({ wipe: event.key === "Home" ? 0 : 1 }); event.preventDefault(); event.stopPropagation(); }
  });

  // ---- Keys: one table, from which the help line is made ----
  const showSingle = (i) => () => (i < sequences.length ? set({ mode: "one", single: i }) : setMode("side"));
  const toggleErrors = () => { if (hasErrors) set({ errors: !state.errors }); };
  const KEYS = [
    { show: ["space"], keys: [" "], help: "play", act: toggle },
    { show: ["\u2190", "\u2192"], keys: ["ArrowRight"], help: "frame", act: () => step(1) },
    { keys: ["ArrowLeft"], act: () => step(-1) },
    { keys: ["Home"], act: () => set({ playing: false, frame: 0 }) },
    { keys: ["End"], act: () => set({ playing: false, frame: frameCount - 1 }) },
    ...sequences.slice(0, 9).map((s, i) => ({ show: [`${i + 1}`], keys: [`${i + 1}`], help: s.name, act: showSingle(i) })),
    { show: [`${Math.min(9, sequences.length + 1)}`], keys: [`${Math.min(9, sequences.length + 1)}`, "s"], help: "side by side", act: () => setMode("side") },
    { show: ["w"], keys: ["w"], help: "wipe", act: () => setMode(state.mode === "wipe" ? "side" : "wipe") },
    { show: ["x"], keys: ["x"], help: "x\u2013t slice", act: () => setMode(state.mode === "slice" ? "side" : "slice") },
    ...(hasErrors ? [{ show: ["e"], keys: ["e"], help: "error maps", act: toggleErrors }] : []),
    { show: ["+", "\u2212"], keys: ["+", "="], help: "zoom", act: () => zoomBy(Math.SQRT2) },
    { keys: ["-"], act: () => zoomBy(Math.SQRT1_2) },
    { show: ["f"], keys: ["f", "0"], help: "fit", act: fit },
    { keys: ["ArrowUp"], act: () => (state.mode === "slice" ? set({ row: state.row - 1 }) : set({ centre: [state.centre[0], clamp(state.centre[1] - 8 / state.zoom, 0, height)] })) },
    { keys: ["ArrowDown"], act: () => (state.mode === "slice" ? set({ row: state.row + 1 }) : set({ centre: [state.centre[0], clamp(state.centre[1] + 8 / state.zoom, 0, height)] })) },
  ];
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const target = event.target;
    if (target.matches("select")) return;
    if (target.matches("input[type=range]") && /^(Arrow|Home|End|Page)/.test(event.key)) return;
    // Space presses the button that the keyboard has reached; after a mouse click it still plays.
    if (event.key === " " && target.matches("button:focus-visible")) return;
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
  if (!data.command) byId("command").parentElement.hidden = true;
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
    button.id = `single-${i}`;
    button.title = `Only ${s.name} (${i + 1})`;
    button.append(dot(i), s.name);
    button.addEventListener("click", showSingle(i));
    byId("singles").append(button);
    for (const id of ["wipe-a", "wipe-b"]) byId(id).append(new Option(s.name, i));
    if (s.description) {
      const term = element("dt");
      term.append(dot(i), s.name);
      byId("descriptions").append(term, element("dd", "", s.description));
    }
  });
  for (const mode of ["side", "wipe", "slice"]) byId(`mode-${mode}`).addEventListener("click", () => setMode(mode));
  byId("wipe-a").addEventListener("change", (e) => set({ wipeA: +e.target.value }));
  byId("wipe-b").addEventListener("change", (e) => set({ wipeB: +e.target.value }));
  byId("slice-row").max = height - 1;
  byId("slice-row").addEventListener("input", (e) => set({ row: +e.target.value }));
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
  for (const f of data.frames.keys()) {
    // A dot under each frame that has everything, where not all have.
    if (!complete(f) || data.frames.every((_, g) => complete(g))) continue;
    const tick = element("i");
    tick.style.left = `${frameCount > 1 ? (f / (frameCount - 1)) * 100 : 50}%`;
    tick.title = `frame ${data.frames[f]} has a reference`;
    byId("ticks").append(tick);
  }
  const table = (id, content, decorate) => {
    if (!content.rows.length) return;
    byId(id).hidden = false;
    const head = element("tr");
    head.append(...content.head.map((text) => element("th", "", text)));
    const rows = content.rows.map((cells, r) => {
      const row = element("tr");
      row.append(...cells.map((text) => element("td", "", text)));
      decorate(row, cells, r);
      return row;
    });
    const thead = element("thead");
    const body = element("tbody");
    thead.append(head);
    body.append(...rows);
    byId(id).querySelector("table").append(thead, body);
  };
  table("metrics", data.metrics, (row, cells, r) => {
    row.children[0].prepend(dot(r));
    const better = data.metrics.head.indexOf("better");
    if (r > 0 && better >= 0) row.children[better].className = "good";
  });
  const timeColumn = data.stages.head.indexOf("median ms");
  const isSum = (cells) => cells[0] === "sum";
  const longest = Math.max(1e-9, ...data.stages.rows.filter((c) => !isSum(c)).map((c) => +c[timeColumn] || 0));
  table("stages", data.stages, (row, cells) => {
    if (isSum(cells)) { row.className = "sum"; return; }
    if (timeColumn < 0) return;
    row.children[timeColumn].classList.add("timed");
    row.children[timeColumn].style.setProperty("--part", `${((+cells[timeColumn] || 0) / longest) * 100}%`);
  });
  if (data.notes.length) {
    byId("notes").hidden = false;
    byId("notes").querySelector("ul").append(...data.notes.map((text) => element("li", "", text)));
  }

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
