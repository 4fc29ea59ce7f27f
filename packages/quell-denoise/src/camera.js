// Cameras for shaders: the struct `Frame` and what of `Prepare` cameras tell, from matrices (docs/shaders.md). Twin of
// crates/quell/src/camera.rs. JavaScript's numbers are doubles: differences are taken in them and rounded at the end.

import { QuellError, checkNames, shown } from "./error.js";

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scaled = (a, k) => a.map((v) => v * k);
const sum = (a, ka, b, kb) => a.map((v, i) => v * ka + b[i] * kb);
const length = (a) => Math.hypot(a[0], a[1], a[2]);
const unit = (a) => {
  const l = length(a);
  return l > 0 ? scaled(a, 1 / l) : [0, 0, 0];
};

/** Where row w is so much shorter than x and y, rays are parallel: as in camera.rs. */
const PARALLEL = 1e-6;

/**
 * The product of two column-major 4x4 matrices, in doubles: `clipFromWorld(projection, view)`.
 * @param {ArrayLike<number>} a
 * @param {ArrayLike<number>} b
 */
export function multiplied(a, b) {
  return Array.from({ length: 16 }, (_, i) => {
    const [column, row] = [i >> 2, i & 3];
    let total = 0;
    for (let k = 0; k < 4; k++) total += a[4 * k + row] * b[4 * column + k];
    return total;
  });
}

function numbers(quantity, value, count) {
  const list = Array.isArray(value) || ArrayBuffer.isView(value) ? Array.from(value) : null;
  if (list?.length !== count) throw new QuellError(quantity, value, `is ${shown(value)}, not ${count} numbers`);
  const bad = list.findIndex((v) => typeof v !== "number" || !Number.isFinite(v));
  if (bad >= 0) throw new QuellError(`${quantity}[${bad}]`, list[bad], `is ${shown(list[bad])}, not a finite number`);
  return list;
}

const CAMERA = ["clipFromWorld", "jitter", "position"];

/** A camera as a host gave it, checked and copied: the host may write into its matrix again. */
export function taken(quantity, camera) {
  checkNames(quantity, camera, CAMERA);
  const clipFromWorld = numbers(`${quantity}.clipFromWorld`, camera.clipFromWorld, 16);
  const jitter = camera.jitter === undefined ? [0, 0] : numbers(`${quantity}.jitter`, camera.jitter, 2);
  const position = camera.position === undefined ? null : numbers(`${quantity}.position`, camera.position, 3);
  return { clipFromWorld, jitter, position };
}

/** The map between pixels and the world of a camera that was taken, for images of [width, height]. */
export class View {
  constructor(quantity, { clipFromWorld: m, position }, [width, height]) {
    const row = (r) => [m[r], m[4 + r], m[8 + r], m[12 + r]];
    const [x, y, w] = [row(0), row(1), row(3)];
    this.z = row(2);
    // Homogeneous pixel coordinate (u, v, w) of a point X: factors . X + constant.
    const u = sum(x, width / 2, w, width / 2);
    const v = sum(w, height / 2, y, -height / 2);
    this.rows = { u, v, w };
    this.x = x;
    this.y = y;
    const l = length(w);
    const scale = Math.max(length(x), length(y));
    const singular = () => new QuellError(`${quantity}.clipFromWorld`, m, `is ${shown(m)}, which is no camera: it is singular`);
    if (!(scale > 0)) throw singular();
    this.perspective = l > PARALLEL * scale;
    if (this.perspective) {
      // Columns of the inverse of the matrix whose rows are the factors of u, v, w.
      const columns = [cross(v, w), cross(w, u), cross(u, v)];
      const [c1, c2, c3] = columns.map((c) => scaled(c, 1 / dot(w, columns[2])));
      this.eye = [0, 1, 2].map((i) => Math.fround(-(c1[i] * u[3] + c2[i] * v[3] + c3[i] * w[3])));
      this.origin = [this.eye, [0, 0, 0], [0, 0, 0]];
      this.direction = [c3, c1, c2].map((c) => scaled(c, l));
      this.forward = scaled(w.slice(0, 3), 1 / l);
      this.focalPx = length(sum(v, 1, w, -height / 2)) / l;
    } else {
      if (!position) {
        throw new QuellError(`${quantity}.position`, undefined, "is missing: an orthographic camera needs it, three numbers");
      }
      if (w[3] === 0) throw singular();
      this.eye = position.map(Math.fround);
      this.forward = unit(scaled(cross(x, y), -1));
      const [a, b] = [scaled(u.slice(0, 3), 1 / w[3]), scaled(v.slice(0, 3), 1 / w[3])];
      const columns = [cross(b, this.forward), cross(this.forward, a), cross(a, b)];
      const [c1, c2, c3] = columns.map((c) => scaled(c, 1 / dot(this.forward, columns[2])));
      const [k1, k2, k3] = [-u[3] / w[3], -v[3] / w[3], dot(this.forward, this.eye)];
      this.origin = [[0, 1, 2].map((i) => Math.fround(c1[i] * k1 + c2[i] * k2 + c3[i] * k3)), c1, c2];
      this.direction = [this.forward, [0, 0, 0], [0, 0, 0]];
      this.focalPx = length(b);
    }
    const all = [...this.eye, ...this.origin.flat(), ...this.direction.flat(), ...this.forward, this.focalPx];
    if (!all.every(Number.isFinite)) throw singular();
  }

  /** The struct `View`, as a frame with this eye is told it. */
  told(eye) {
    const row = (r) => [r[0], r[1], r[2], dot(r, this.eye) + r[3]];
    return {
      origin: [sum(this.origin[0], 1, this.eye, -1), this.origin[1], this.origin[2]],
      direction: this.direction,
      u: row(this.rows.u),
      v: row(this.rows.v),
      w: row(this.rows.w),
      forward: this.forward,
      focal_px: this.focalPx,
      eye: this.eye.map((value, i) => value - eye[i]),
      perspective: this.perspective ? 1 : 0,
    };
  }

  /** The camera's axes to the right and up, row z, and the device depth of what is farthest away. */
  device() {
    const axis = (r) => unit(sum(r.slice(0, 3), 1, this.forward, -dot(r, this.forward)));
    const at = (r) => dot(r, this.eye) + r[3];
    const { z, rows: { w } } = this;
    const [zEye, wEye, zStep, wStep] = [at(z), at(w), dot(z, this.forward), dot(w, this.forward)];
    // View depth on the axis where z / w is `d`; nowhere, or behind the eye: beyond infinity.
    const depth = (d) => {
      const t = (d * wEye - zEye) / (zStep - d * wStep);
      return Number.isFinite(t) && (t > 0 || !this.perspective) ? t : Infinity;
    };
    return {
      right: axis(this.x),
      up: axis(this.y),
      device_z: [z[0], z[1], z[2], zEye],
      device_far: depth(0) > depth(1) ? 0 : 1,
    };
  }
}

/**
 * The members of the struct `Frame`.
 * @param now     { view, previousView, jitter, hasGlossyHit, hasRoughness }
 * @param before  the same of the frame before; null: this one starts afresh
 * @param extent  [width, height]
 */
export function frameStruct(now, before, extent) {
  const { eye } = now.view;
  const earlier = before ?? now;
  const history = before ? 1 : 0;
  return {
    view: now.view.told(eye),
    previous_view: now.previousView.told(eye),
    before_view: earlier.view.told(eye),
    jitter: now.jitter,
    before_jitter: earlier.jitter,
    size: extent,
    before_size: extent,
    to_before: [1, 1],
    // No tile of a larger picture.
    origin: [0, 0],
    whole: extent,
    matte_history: history,
    glossy_history: history,
    direct_history: history,
    has_glossy_hit: now.hasGlossyHit ? 1 : 0,
    has_roughness: now.hasRoughness ? 1 : 0,
    picture_history: history,
  };
}
