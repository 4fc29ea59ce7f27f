// Which passes a frame runs, what each binds and what comes out: twin of crates/quell/src/pipeline.rs (`Plan::new`) and
// crates/quell/src/gpu/builder.rs. A test compares the programs of all choices.

const f = Math.fround;
const GUIDES = ["guides geometry", "guides surface", "guides moving"];
const BEFORE = ["guides geometry", "guides surface"];

/** What a binding has: a resource, and whether the copy that the frame before wrote. */
const now = (resource) => ({ resource, copy: "this" });
const earlier = (resource) => ({ resource, copy: "before" });

/** Steps of a frame by the names of images; where each image lies is known when all of them are. */
class Steps {
  list = [];
  add(pass, input, output, prefiltered) {
    this.list.push({ pass, input, output, prefiltered });
    return output;
  }
}

/** Twin of `ends` in crates/quell/src/stages/young_filter/mod.rs: pixels between taps, and the history length that ends the level. */
export function youngEnds(settings, signal) {
  const isMatte = signal === "matte";
  const end1 = f(settings["young_filter.frames"]);
  const falloff = f(settings["young_filter.falloff"]);
  const end3 = f(end1 * falloff);
  const ends = isMatte && settings["young_filter.matte_stays"] ? [1e9, 1e9, 1e9] : [end1, end3, f(end3 * falloff)];
  ends.push(isMatte && ends[2] > 1 ? f(settings["young_filter.wide_frames"]) : 0);
  const levels = settings[`young_filter.${signal}_levels`];
  return ends.map((end, level) => [3 ** level, level < levels ? end : 0]);
}

/** The levels of the filter of young history that a history of one frame needs; the last one's output. */
function youngSteps(steps, settings, signal, input) {
  const acting = youngEnds(settings, signal).filter(([, end]) => end > 1);
  return acting.reduce((image, [apart]) => steps.add(`${signal}_young_${apart}`, image, `${signal} young ${apart}`), input);
}

/** Stages 3 to 7; the image that is shown, and the one that is the next frame's history. */
function matteSteps(steps, settings) {
  const isOn = (stage) => settings[`${stage}.enabled`];
  const feedback = settings["pipeline.feedback"];
  const temporal = isOn("matte_temporal");
  // As the next frame's history it stays as it is; every other stage sees the filtered one.
  const unfiltered = temporal ? steps.add("matte_temporal", "matte input", "matte temporal") : "matte input";
  const accumulated = temporal && settings["young_filter.matte"] ? youngSteps(steps, settings, "matte", unfiltered) : unfiltered;
  // Work that nobody reads is left out.
  const isRead = !temporal || isOn("disocclusion") || feedback === "prefilter";
  const prefiltered = isOn("matte_prefilter") && isRead ? steps.add("matte_prefilter", accumulated, "matte prefiltered") : accumulated;
  // Without history everything is fresh: the blend would be the prefiltered image.
  let blended = temporal ? accumulated : prefiltered;
  let floored = blended;
  if (temporal && isOn("disocclusion") && prefiltered !== accumulated) {
    blended = steps.add("disocclusion", accumulated, "matte blended", prefiltered);
    floored = "matte blended with floor";
  }
  const medianInput = settings["firefly.input"] === "temporal" ? accumulated : blended;
  const median = isOn("firefly") ? steps.add("firefly", medianInput, "matte median") : blended;
  const filtered = isOn("matte_bilateral") ? steps.add("matte_bilateral", median, "matte filtered") : median;
  const fed = { temporal: unfiltered, prefilter: prefiltered, blend: floored, firefly: median, bilateral: filtered }[feedback];
  return { shown: filtered, fed: temporal ? fed : null };
}

/** Stages 8 to 10. */
function glossySteps(steps, settings) {
  let shown = "glossy input";
  let fed = null;
  if (settings["glossy_temporal.enabled"]) {
    shown = steps.add("glossy_temporal", shown, "glossy temporal");
    fed = shown;
    if (settings["young_filter.glossy"]) shown = youngSteps(steps, settings, "glossy", shown);
  }
  if (settings["glossy_bilateral.enabled"]) {
    shown = steps.add("glossy_bilateral_h", shown, "glossy horizontal");
    shown = steps.add("glossy_bilateral_v", shown, "glossy filtered");
  }
  return { shown, fed };
}

/**
 * The passes of a frame in order, each with what it binds after the uniforms `frame` and `settings`, and what comes out.
 * @param {Record<string, unknown>} settings  the value of every parameter
 * @param {readonly string[]} signals         `matte`, `glossy` or both
 * @param {boolean} jitter
 * @returns {{ dispatches: { pass: string, bound: { resource: string, copy: "this" | "before" }[] }[], outputs: Record<string, string | null> }}
 */
export function planned(settings, signals, jitter) {
  const steps = new Steps();
  const has = (signal) => signals.includes(signal);
  const nothing = (signal) => ({ shown: `${signal} input`, fed: null });
  const matte = has("matte") ? matteSteps(steps, settings) : nothing("matte");
  const glossy = has("glossy") ? glossySteps(steps, settings) : nothing("glossy");
  // The picture as a whole or its direct light alone.
  const antialiases = jitter && settings["antialiasing.enabled"];
  const direct = jitter && settings["direct_taa.enabled"] && !antialiases ? steps.add("direct_taa", "direct input", "direct history") : "direct input";

  /** What is remembered lies in the history, whichever stage writes it. */
  const name = (image) => {
    if (image === matte.fed) return "matte history";
    return image === glossy.fed ? "glossy history" : image;
  };
  const place = (image) => now(name(image));
  const find = (pass) => steps.list.find((step) => step.pass === pass);
  const accumulating = (signal, { input, output }) => (
    [place(input), earlier(`${signal} history`), earlier(`${signal} length`), place(output), now(`${signal} length`)]
  );
  const guides = (count) => GUIDES.slice(0, count).map(now);
  const around = [...guides(3), ...BEFORE.map(earlier)];
  // Stage 8 may look at the hit distances of the frame before; where it does not, any plane will do.
  const comparesHits = glossy.fed !== null && settings["glossy_temporal.virtual_reprojection"] && settings["glossy_temporal.mirror_roughness"] > 0;
  const aroundMirrors = [...around, { resource: GUIDES[2], copy: comparesHits ? "before" : "this" }];
  const bound = ({ pass, input, output, prefiltered }) => {
    const [from, to] = [place(input), place(output)];
    const signal = pass.split("_")[0];
    switch (pass) {
      case "matte_temporal": return [...around, ...accumulating(signal, { input, output })];
      case "glossy_temporal": return [...aroundMirrors, ...accumulating(signal, { input, output })];
      case "matte_prefilter": case "matte_bilateral": return [...guides(2), now(`${pass.replace("_", " ")} taps`), from, to];
      case "disocclusion": return [from, place(prefiltered), to, place("matte blended with floor")];
      case "firefly": return [...guides(1), from, to];
      case "glossy_bilateral_h": case "glossy_bilateral_v": return [...guides(3), from, to];
      case "direct_taa": return [now(GUIDES[0]), now(GUIDES[2]), from, earlier("direct history"), to];
      // A level of the filter of young history; the one that stage 5 reads hands the confidence on.
      default: {
        const isRead = find("disocclusion")?.input === output;
        return [...guides(2), from, now(`${signal} length`), isRead ? place("matte temporal") : from, to];
      }
    }
  };

  const bothTemporal = find("matte_temporal") && find("glossy_temporal");
  const [blend, median] = [find("disocclusion"), find("firefly")];
  const isMedianOfBlend = blend && median?.input === blend.output;
  const prepare = [
    "repairs", "depth buffer", "view depth", "normal", "motion", "roughness", "glossy hit distance", "surface id", "confidence in", ...GUIDES,
  ];
  const dispatches = [{ pass: "prepare", bound: prepare.map(now) }];
  for (const step of steps.list) {
    const { pass } = step;
    if (pass === "matte_temporal" && bothTemporal) {
      const both = ["matte", "glossy"].flatMap((signal) => accumulating(signal, find(`${signal}_temporal`)));
      dispatches.push({ pass: "matte_temporal+glossy_temporal", bound: [...aroundMirrors, ...both] });
    } else if (pass === "disocclusion" && isMedianOfBlend) {
      const [from, prefiltered, , floored] = bound(step);
      dispatches.push({ pass: "disocclusion+firefly", bound: [from, prefiltered, floored, place(median.output)] });
    } else if (!(pass === "glossy_temporal" && bothTemporal) && !(pass === "firefly" && isMedianOfBlend)) {
      // Stages 3, 8 and 11 repair the host's colours always.
      const isFirst = step.input.endsWith(" input") && !/_temporal$|^direct_taa$/.test(pass);
      dispatches.push({ pass: isFirst ? `${pass}, first` : pass, bound: bound(step) });
    }
  }
  const terms = ["matte", "glossy"].map((signal) => ({ signal, shown: { matte, glossy }[signal].shown }));
  // What is not there is not read: any colour will do.
  const orAny = (signal, resource) => now(has(signal) ? resource : direct);
  dispatches.push({
    pass: "composite",
    bound: [
      now(direct),
      ...terms.map(({ signal, shown }) => orAny(signal, name(shown))),
      ...terms.map(({ signal }) => orAny(signal, `direct ${signal}`)),
      ...terms.map(({ signal }) => orAny(signal, `${signal} weight`)),
      now("composite"),
    ],
  });
  const picture = antialiases ? "picture anti-aliased" : "composite";
  if (antialiases) {
    const history = "picture history";
    dispatches.push({
      pass: "antialiasing",
      bound: [now(GUIDES[0]), now(GUIDES[2]), now("composite"), earlier(history), now(history), now(picture)],
    });
  }
  const [temporal] = ["matte", "glossy"].filter((signal) => find(`${signal}_temporal`));
  const shown = (signal) => (has(signal) ? name({ matte, glossy }[signal].shown) : null);
  return {
    dispatches,
    outputs: {
      composite: picture,
      direct,
      matte: shown("matte"),
      glossy: shown("glossy"),
      confidence: temporal ? name(`${temporal} temporal`) : null,
      history_length: temporal ? `${temporal} length` : null,
    },
  };
}
