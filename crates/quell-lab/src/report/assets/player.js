(() => {
  const data = JSON.parse(byId("data").textContent);
  const { sequences, width, height } = data;
  const frameCount = data.frames.length;
  const colourOf = (i) => `var(--series-${i % 4})`;

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

  const isReference = (s) => !sequences[s].errors.some(Boolean) && sequences[s].name.startsWith("reference");
  const nearest = (s, f) => {
    for (let d = 0; d < frameCount; d++) {
      for (const g of [f - d, f + d]) if (sequences[s].pictures[g]) return g;
    }
    return -1;
  };

  // ---- Layout: which sequence stands where, in CSS pixels ----
  const SNAP = 1.3; // up to this factor smaller, for whole screen pixels
  const layout = (available, ratioOfPixels) => {
    const tallest = Math.max(200, window.innerHeight * 0.7);
    const shown = state.mode === "side" || state.mode === "slice" ? sequences.map((_, i) => i)
      : state.mode === "wipe" ? [state.wipeA] : [state.single];
    const columns = available < 720 ? 1 : shown.length;
    const rows = Math.ceil(shown.length / columns);
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
    const panels = shown.map((s, i) => ({
      s,
      x: margin + (i % columns) * (panelWidth + GAP),
      y: Math.floor(i / columns) * (panelHeight + GAP),
      w: panelWidth,
      h: panelHeight,
    }));
    return { panels, total: rows * panelHeight + (rows - 1) * GAP };
  };

  // ---- Drawing ----
  /** Where there is nothing, what is near stands in, faint. */
  const picture = (s) => {
    const f = state.frame;
    if (!sequences[s].pictures[f]) {
      const other = nearest(s, f);
      return { picture: other >= 0 ? view.image("pictures", s, other) : null, alpha: 0.28 };
    }
    const wantsMap = state.errors && !isReference(s);
    const map = wantsMap ? view.errorMap(s, f) : null;
    return { picture: map || view.image("pictures", s, f), alpha: wantsMap && !map ? 0.3 : 1 };
  };
  const drawSlice = (panel) => {
    const { context } = view;
    const rows = Math.max(1, Math.floor(panel.h / frameCount));
    const scaleX = panel.w / width;
    context.beginPath();
    context.rect(panel.x, panel.y, panel.w, panel.h);
    context.clip();
    context.imageSmoothingEnabled = false;
    for (let f = 0; f < frameCount; f++) {
      const top = panel.y + Math.round((f * panel.h) / frameCount);
      const bottom = panel.y + Math.round(((f + 1) * panel.h) / frameCount);
      const map = state.errors && !isReference(panel.s) ? view.errorMap(panel.s, f) : null;
      const picture = map || (state.errors && !isReference(panel.s) ? null : view.image("pictures", panel.s, f));
      if (picture) context.drawImage(picture, 0, state.row, width, 1, panel.x, top, width * scaleX, Math.max(bottom - top, rows));
    }
    const y = panel.y + ((state.frame + 0.5) * panel.h) / frameCount;
    context.fillStyle = "rgba(255,255,255,.85)";
    context.beginPath();
    context.moveTo(panel.x, y - 5); context.lineTo(panel.x + 7, y); context.lineTo(panel.x, y + 5);
    context.fill();
  };

  // ---- Everything beside the canvas ----
  let overlayKey = "";
  const describe = () => {
    const overlay = byId("overlay");
    const panels = view.panels();
    const key = JSON.stringify([panels, state.mode, state.frame, state.errors, state.wipeA, state.wipeB, state.playing, state.mode === "slice" ? state.row : 0]);
    if (key !== overlayKey) {
      overlayKey = key;
      overlay.replaceChildren();
      const chip = (s, x, y, fromRight) => {
        const isMap = state.errors && !isReference(s) && sequences[s].errors[state.frame];
        const more = state.mode === "slice" ? `row ${state.row}, time runs down` : isMap ? "error map" : "";
        view.chip(colourOf(s), more ? [sequences[s].name, element("small", "", more)] : [sequences[s].name], x, y, fromRight);
      };
      const absent = (panel, s) => {
        const f = state.frame;
        const needsReference = state.errors && !isReference(s) && !sequences[s].errors[f];
        if (state.mode === "slice" || (sequences[s].pictures[f] && !needsReference)) return;
        const list = needsReference ? sequences[s].errors : sequences[s].pictures;
        const others = data.frames.filter((_, g) => list[g]);
        if (others.length === 0) {
          view.absent(panel, element("span", "", "no reference, so no error map"));
          return;
        }
        if (state.playing) return;
        const target = data.frames.map((_, g) => g).filter((g) => list[g]).sort((a, b) => Math.abs(a - f) - Math.abs(b - f))[0];
        const jump = element("button", "", `go to frame ${data.frames[target]}`);
        jump.type = "button";
        jump.addEventListener("click", () => view.set({ frame: target }));
        view.absent(panel, element("span", "", `no reference for frame ${data.frames[f]}`), jump);
      };
      for (const panel of panels) {
        if (state.mode === "wipe") {
          chip(state.wipeA, panel.x, panel.y);
          chip(state.wipeB, 0, panel.y, byId("viewer").clientWidth - panel.x - panel.w);
          absent(panel, sequences[state.wipeA].pictures[state.frame] ? state.wipeB : state.wipeA);
        } else {
          chip(panel.s, panel.x, panel.y);
          absent(panel, panel.s);
        }
      }
    }
    for (const [i, button] of [...byId("singles").children].entries()) button.setAttribute("aria-pressed", state.mode === "one" && state.single === i);
    byId("slice-value").textContent = state.row;
    byId("slice-row").style.setProperty("--part", `${(state.row / Math.max(1, height - 1)) * 100}%`);
  };

  const view = makeViewer(data, state, {
    sequences,
    modes: ["side", "wipe", "slice"],
    rows: height,
    mapName: "error",
    mapsTitle: "Error maps",
    hint: "Point at a picture to read its pixels; wheel to zoom, drag to move.",
    layout,
    picture,
    drawSlice,
    pointed: () => sequences.keys(),
    needed: () => [...sequences.keys()],
    dragSlice: (dy) => view.set({ row: state.row + Math.sign(Math.round(dy)) }),
    describe,
  });
  const setMode = (mode) => view.set({ mode });

  // ---- Keys ----
  const showSingle = (i) => () => (i < sequences.length ? view.set({ mode: "one", single: i }) : setMode("side"));
  view.bindKeys([
    ...sequences.slice(0, 9).map((s, i) => ({ show: [`${i + 1}`], keys: [`${i + 1}`], help: s.name, act: showSingle(i) })),
    { show: [`${Math.min(9, sequences.length + 1)}`], keys: [`${Math.min(9, sequences.length + 1)}`, "s"], help: "side by side", act: () => setMode("side") },
    { show: ["w"], keys: ["w"], help: "wipe", act: () => setMode(state.mode === "wipe" ? "side" : "wipe") },
    { show: ["x"], keys: ["x"], help: "x\u2013t slice", act: () => setMode(state.mode === "slice" ? "side" : "slice") },
    { keys: ["ArrowUp"], act: () => (state.mode === "slice" ? view.set({ row: state.row - 1 }) : view.set({ centre: [state.centre[0], clamp(state.centre[1] - 8 / state.zoom, 0, height)] })) },
    { keys: ["ArrowDown"], act: () => (state.mode === "slice" ? view.set({ row: state.row + 1 }) : view.set({ centre: [state.centre[0], clamp(state.centre[1] + 8 / state.zoom, 0, height)] })) },
  ]);

  // ---- Build the page ----
  if (!data.command) byId("command").parentElement.hidden = true;
  sequences.forEach((s, i) => {
    const button = element("button");
    button.type = "button";
    button.id = `single-${i}`;
    button.title = `Only ${s.name} (${i + 1})`;
    button.append(dot(colourOf(i)), s.name);
    button.addEventListener("click", showSingle(i));
    byId("singles").append(button);
    if (s.description) {
      const term = element("dt");
      term.append(dot(colourOf(i)), s.name);
      byId("descriptions").append(term, element("dd", "", s.description));
    }
  });
  for (const mode of ["side", "wipe", "slice"]) byId(`mode-${mode}`).addEventListener("click", () => setMode(mode));
  byId("slice-row").max = height - 1;
  byId("slice-row").addEventListener("input", (e) => view.set({ row: +e.target.value }));
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
    // Columns in which no row says anything are left out.
    const said = content.head.map((_, c) => c).filter((c) => content.rows.some((cells) => !["", "-"].includes(cells[c])));
    const heads = said.map((c) => content.head[c]);
    const head = element("tr");
    head.append(...heads.map((text) => element("th", "", text)));
    const rows = content.rows.map((all, r) => {
      const row = element("tr");
      const cells = said.map((c) => all[c]);
      row.append(...cells.map((text) => element("td", "", text)));
      decorate(row, cells, r, heads);
      return row;
    });
    const thead = element("thead");
    const body = element("tbody");
    thead.append(head);
    body.append(...rows);
    byId(id).querySelector("table").append(thead, body);
  };
  table("metrics", data.metrics, (row, cells, r, heads) => {
    row.children[0].prepend(dot(colourOf(r)));
    const lower = heads.indexOf("lower by");
    if (r > 0 && lower >= 0) row.children[lower].className = "good";
  });
  const isSum = (cells) => cells[0] === "sum";
  const medians = data.stages.rows.filter((c) => !isSum(c)).map((c) => +c[data.stages.head.indexOf("median ms")] || 0);
  const longest = Math.max(1e-9, ...medians);
  table("stages", data.stages, (row, cells, _, heads) => {
    const median = heads.indexOf("median ms");
    if (isSum(cells)) row.className = "sum";
    if (isSum(cells) || median < 0) return;
    row.children[median].classList.add("timed");
    row.children[median].style.setProperty("--part", `${((+cells[median] || 0) / longest) * 100}%`);
  });
  view.start();
})();
