(() => {
  const data = JSON.parse(byId("data").textContent);
  const { width, height, panels: sequences } = data;
  const frameCount = data.frames.length;
  const REFERENCE = sequences.findIndex((s) => s.name === "reference");
  const SERIES = 11;
  const order = [...new Set([...sequences.map((s) => s.name), ...data.methods.map((m) => m.name)])];
  const colourOf = (name) => `var(--series-${order.indexOf(name) % SERIES})`;
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

  const hasSlices = data.slice_rows.length > 0 && sequences.some((s) => s.slices.length);

  // ---- Layout: which sequence stands where, in CSS pixels ----
  const NARROWEST = 220; // a panel is never narrower, where there is room for one at all
  const SLICE_SHAPE = 0.56; // height over width of a slice's panel
  const layout = (available, ratio) => {
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
    let w = Math.floor((available - GAP * (columns - 1)) / columns);
    if (wanted.length === 1) w = Math.min(w, Math.floor(tallest / shape));
    const scale = (w * ratio) / width;
    // A little room is given up where that makes every pixel a whole number of the screen's.
    if (state.mode !== "slice" && scale >= 1 && Math.floor(scale) * 1.25 > scale) w = Math.floor((Math.floor(scale) * width) / ratio);
    const h = Math.round(w * shape);
    const rows = Math.ceil(wanted.length / columns);
    const margin = Math.max(0, Math.floor((available - w * columns - GAP * (columns - 1)) / 2));
    const panels = wanted.map((s, i) => ({ s, x: margin + (i % columns) * (w + GAP), y: Math.floor(i / columns) * (h + GAP), w, h }));
    return { panels, total: Math.max(60, rows * h + Math.max(0, rows - 1) * GAP) };
  };

  // ---- Drawing ----
  const picture = (s) => {
    const isMap = state.errors && sequences[s].errors[state.frame];
    return { picture: isMap ? view.errorMap(s, state.frame) : view.image("pictures", s, state.frame) };
  };
  const drawSlice = (panel) => {
    const slice = view.load(`slice ${panel.s} ${state.row}`, sequences[panel.s].slices[state.row]);
    if (!slice) return;
    const { context } = view;
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

  // ---- Everything beside the canvas ----
  let overlayKey = "";
  const describe = () => {
    const overlay = byId("overlay");
    const panels = view.panels();
    const key = JSON.stringify([panels, state.mode, state.frame, state.errors, state.wipeA, state.wipeB]);
    if (key !== overlayKey) {
      overlayKey = key;
      overlay.replaceChildren();
      const chip = (s, x, y, fromRight) => {
        const { name, flip } = sequences[s];
        const value = state.mode === "slice" ? undefined : flip[state.frame];
        view.chip(colourOf(name), typeof value === "number" ? [name, element("small", "", `FLIP ${value.toFixed(3)}`)] : [name], x, y, fromRight);
      };
      for (const panel of panels) {
        if (state.mode === "wipe") {
          chip(state.wipeA, panel.x, panel.y);
          chip(state.wipeB, 0, panel.y, byId("viewer").clientWidth - panel.x - panel.w);
        } else {
          chip(panel.s, panel.x, panel.y);
          if (state.mode !== "slice" && !sequences[panel.s].pictures[state.frame]) {
            view.absent(panel, element("span", "", `no picture of frame ${data.frames[state.frame]}`));
          }
        }
      }
    }
    for (const [i, button] of [...byId("chips").children].entries()) if (i < sequences.length) button.setAttribute("aria-pressed", state.shown[i]);
    byId("chips").hidden = state.mode !== "grid" && state.mode !== "slice";
    byId("one-choice").hidden = state.mode !== "one";
    byId("one-method").value = state.single;
    const current = state.mode === "one" ? sequences[state.single].name : "";
    for (const row of document.querySelectorAll("#tables tbody tr")) row.classList.toggle("current", row.dataset.method === current);
  };

  const view = makeViewer(data, state, {
    sequences,
    modes: ["grid", "wipe", "one", "slice"],
    rows: data.slice_rows.length,
    mapName: "FLIP",
    mapsTitle: "FLIP maps",
    hint: "Point at a picture to read its pixels; wheel to zoom, drag to move, all together.",
    layout,
    picture,
    drawSlice,
    pointed: (panel) => [...new Set([...(state.mode === "wipe" ? [state.wipeA, state.wipeB] : [panel.s]), REFERENCE])].filter((s) => s >= 0),
    needed: () => (state.mode === "wipe" ? [state.wipeA, state.wipeB] : view.panels().map((p) => p.s)),
    dragSlice: () => {},
    hasNoLegend: () => state.mode === "slice",
    describe,
  });
  const { set } = view;
  const setMode = (mode) => { if (mode !== "slice" || hasSlices) set({ mode }); };
  const showOne = (i) => { if (i >= 0 && i < sequences.length) set({ mode: "one", single: i }); };
  const flipBy = (by) => {
    if (state.mode === "slice") set({ row: state.row + by });
    else showOne((state.single + by + sequences.length) % sequences.length);
  };

  // ---- Keys ----
  view.bindKeys([
    { show: ["g"], keys: ["g"], help: "grid", act: () => setMode("grid") },
    { show: ["w"], keys: ["w"], help: "wipe", act: () => setMode("wipe") },
    { show: ["o"], keys: ["o"], help: "one", act: () => setMode("one") },
    ...(hasSlices ? [{ show: ["x"], keys: ["x"], help: "x\u2013t slices", act: () => setMode("slice") }] : []),
    ...sequences.slice(0, 9).map((s, i) => ({ keys: [`${i + 1}`], act: () => showOne(i) })),
    { show: [`1\u2013${Math.min(9, sequences.length)}`], keys: [], help: "flip between methods" },
    { show: ["[", "]"], keys: ["]"], help: "next method, next row", act: () => flipBy(1) },
    { keys: ["["], act: () => flipBy(-1) },
    { keys: ["ArrowUp"], act: () => flipBy(-1) },
    { keys: ["ArrowDown"], act: () => flipBy(1) },
  ]);

  // ---- Build the page ----
  if (!data.command) byId("about").hidden = true;
  sequences.forEach((s, i) => {
    const button = element("button");
    button.type = "button";
    button.title = `Show or hide ${s.name}; double click: only it and the reference`;
    button.append(dot(colourOf(s.name)), s.name);
    button.addEventListener("click", () => set({ shown: state.shown.map((v, k) => (k === i ? !v : v)) }));
    button.addEventListener("dblclick", () => set({ shown: state.shown.map((_, k) => k === i || k === REFERENCE) }));
    byId("chips").append(button);
    byId("one-method").append(new Option(s.name, i));
  });
  for (const m of data.methods.filter((m) => m.reason)) {
    const button = element("button");
    button.type = "button";
    button.disabled = true;
    button.title = m.reason;
    button.append(dot(colourOf(m.name)), m.name);
    byId("chips").append(button);
  }
  data.slice_rows.forEach((row, i) => byId("slice-row").append(new Option(row, i)));
  for (const mode of ["grid", "wipe", "one", "slice"]) byId(`mode-${mode}`).addEventListener("click", () => setMode(mode));
  byId("mode-slice").disabled = !hasSlices;
  byId("one-method").addEventListener("change", (e) => showOne(+e.target.value));
  byId("slice-row").addEventListener("change", (e) => set({ row: +e.target.value }));

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
      name.append(dot(colourOf(method.name)), method.name);
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

  view.start();
})();
