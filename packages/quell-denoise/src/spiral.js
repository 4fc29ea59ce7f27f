// The taps of stages 4 and 7: twin of crates/quell/src/kernels/spiral.rs, to the bit (a test compares the tables).

const f = Math.fround;

/** Patterns over 4x4 pixels; they repeat after as many frames. */
export const PHASES = 16;
/** Ranks of a 4x4 Bayer matrix. */
const BAYER = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5];
/** Bytes of the struct `SpiralTap`. */
const TAP = 16;

function bestTurns(taps) {
  for (const [most, turns] of [[3, 1], [7, 2], [15, 5], [33, 7], [64, 11]]) if (taps <= most) return turns;
  return 13;
}

const LN_2_HIGH = f(0.6933594);
const LN_2_LOW = f(-2.1219444e-4);
const LOG2_E = f(Math.LOG2E);
const SERIES = [1 / 720, 1 / 120, 1 / 24, 1 / 6, 0.5, 1, 1].map(f);

/** e^x for x <= 0, every step in single precision. */
function expNegative(x) {
  if (x < -80) return 0;
  const clamped = Math.min(x, 0);
  const k = Math.trunc(f(f(clamped * LOG2_E) - 0.5));
  const r = f(f(clamped - f(k * LN_2_HIGH)) - f(k * LN_2_LOW));
  const p = SERIES.slice(1).reduce((total, factor) => f(factor + f(r * total)), SERIES[0]);
  return f(p * 2 ** k);
}

const SIN_EIGHTH = 0.3826834323650898;
const COS_EIGHTH = 0.9238795325112867;
const [S, C] = [SIN_EIGHTH, COS_EIGHTH];
const MIDDLES = [[S, C], [C, S], [C, -S], [S, -C], [-S, -C], [-C, -S], [-C, S], [-S, C]];

/** Sine and cosine of an angle in turns, by Taylor's series: a browser's own may differ in the last bits. */
function sinCosTurns(turns) {
  const fraction = turns - Math.floor(turns);
  const octant = Math.floor(fraction * 8);
  const a = (fraction - (octant + 0.5) / 8) * (2 * Math.PI);
  const a2 = a * a;
  const s = a * (1 - (a2 / 6) * (1 - (a2 / 20) * (1 - (a2 / 42) * (1 - (a2 / 72) * (1 - a2 / 110)))));
  const c = 1 - (a2 / 2) * (1 - (a2 / 12) * (1 - (a2 / 30) * (1 - (a2 / 56) * (1 - (a2 / 90) * (1 - a2 / 132)))));
  const [sm, cm] = MIDDLES[Math.min(octant, 7)];
  return [sm * c + cm * s, cm * c - sm * s];
}

/**
 * The table of a stage for one frame: what its storage buffer holds.
 * @param s      { taps, radius, sigma, turns, rotate }: the stage's settings
 * @param stage  0: stage 4; 1: stage 7
 * @param rows   of the image
 */
export function packedTaps(s, stage, rows, index) {
  const radius = f(f(f(s.radius) * rows) / 720);
  const sigma = f(s.sigma) * radius;
  const turns = s.turns === 0 ? bestTurns(s.taps) : s.turns;
  const frame = s.rotate ? ((index % PHASES) + PHASES) % PHASES : 0;
  const bytes = new ArrayBuffer(PHASES * s.taps * TAP);
  const view = new DataView(bytes);
  for (let phase = 0; phase < PHASES; phase++) {
    const rank = BAYER[phase];
    const jitter = (((rank * (3 + 8 * stage) + frame * 9 + 5 * stage) % PHASES) + 0.5) / PHASES;
    const spin = (((rank * 5 + frame * 7 + stage * 11) % PHASES) + 0.5 * stage) / PHASES;
    for (let i = 0; i < s.taps; i++) {
      const r = ((i + jitter) / s.taps) * radius;
      const [sin, cos] = sinCosTurns((turns * (i + jitter)) / s.taps + spin);
      const [dx, dy] = [Math.trunc(r * cos), Math.trunc(r * sin)];
      const weight = sigma > 0 ? expNegative(f(-(dx * dx + dy * dy) / (2 * sigma * sigma))) : 0;
      const at = (phase * s.taps + i) * TAP;
      view.setInt32(at, dx, true);
      view.setInt32(at + 4, dy, true);
      view.setFloat32(at + 8, weight, true);
    }
  }
  return bytes;
}

/** The tables of all frames, one after another. */
export function allTaps(s, stage, rows) {
  const each = Array.from({ length: PHASES }, (_, index) => new Uint8Array(packedTaps(s, stage, rows, index)));
  const all = new Uint8Array(PHASES * each[0].length);
  each.forEach((bytes, index) => all.set(bytes, index * bytes.length));
  return all.buffer;
}
