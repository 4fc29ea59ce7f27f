/** What was wrong with an argument: which quantity, and the value that it had. Nothing was encoded or changed. */
export class QuellError extends Error {
  /**
   * @param {string} quantity  name of the argument, such as `textures.normal`
   * @param {unknown} value    what it was
   * @param {string} why       the sentence after the name
   */
  constructor(quantity, value, why) {
    super(`quell: ${quantity} ${why}`);
    this.name = "QuellError";
    this.quantity = quantity;
    this.value = value;
  }
}

/** A value for a sentence: short, whatever it is. */
export function shown(value) {
  if (typeof value === "string") return JSON.stringify(value.length > 60 ? `${value.slice(0, 57)}...` : value);
  if (typeof value === "number" || typeof value === "boolean" || value == null) return String(value);
  if (Array.isArray(value) || ArrayBuffer.isView(value)) {
    const list = Array.from(/** @type {ArrayLike<unknown>} */ (value)).slice(0, 5).map(shown);
    return `[${list.join(", ")}${value.length > 5 ? `, ... (${value.length})` : ""}]`;
  }
  if (typeof value === "bigint") return `${value}n`;
  return typeof value === "object" ? (value.constructor?.name ?? "object") : typeof value;
}

/** Refuses members of an object that nobody reads: a name misspelt would count as absent, and only blur. */
export function checkNames(quantity, object, known) {
  if (object === null || typeof object !== "object") {
    throw new QuellError(quantity, object, `is ${shown(object)}, not an object`);
  }
  for (const name of Object.keys(object)) {
    if (!known.includes(name)) {
      throw new QuellError(`${quantity}.${name}`, object[name], `is unknown${likely(name, known)}`);
    }
  }
}

/** "; did you mean ...?", or the list of what there is. */
export function likely(name, known) {
  const near = known.map((other) => [distance(name.toLowerCase(), other.toLowerCase()), other]).sort((a, b) => a[0] - b[0])[0];
  if (near && near[0] <= Math.max(2, name.length / 3)) return `; did you mean ${near[1]}?`;
  return known.length <= 20 ? `; known: ${known.join(", ")}` : "";
}

/** Levenshtein's distance. */
function distance(a, b) {
  let row = Array.from({ length: b.length + 1 }, (_, i) => i);
  for (let i = 1; i <= a.length; i++) {
    const next = [i];
    for (let k = 1; k <= b.length; k++) {
      next[k] = Math.min(next[k - 1] + 1, row[k] + 1, row[k - 1] + (a[i - 1] === b[k - 1] ? 0 : 1));
    }
    row = next;
  }
  return row[b.length];
}
