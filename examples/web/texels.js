// Textures read back, and what their texels hold.

/** Bytes a texel. */
export const BYTES = {
  rgba32float: 16, rgba16float: 8, rg32float: 8, r32float: 4, rgba32uint: 16, rg32uint: 8, r32uint: 4, rgba8unorm: 4,
};
/** Rows in a buffer begin at multiples of this. */
const ALIGNMENT = 256;

/** The bytes of a texture, rows without gaps. */
export async function read(device, texture) {
  const { width, height, format } = texture;
  const row = BYTES[format] * width;
  const padded = Math.ceil(row / ALIGNMENT) * ALIGNMENT;
  const { MAP_READ, COPY_DST } = GPUBufferUsage;
  const buffer = device.createBuffer({ label: "read back", size: padded * height, usage: MAP_READ | COPY_DST });
  const encoder = device.createCommandEncoder();
  encoder.copyTextureToBuffer({ texture }, { buffer, bytesPerRow: padded }, [width, height]);
  device.queue.submit([encoder.finish()]);
  await buffer.mapAsync(GPUMapMode.READ);
  const from = new Uint8Array(buffer.getMappedRange());
  const bytes = new Uint8Array(row * height);
  for (let y = 0; y < height; y++) bytes.set(from.subarray(y * padded, y * padded + row), y * row);
  buffer.destroy();
  return bytes.buffer;
}

/** A number from the bits of a half. */
function half(bits) {
  const [exponent, fraction] = [(bits >> 10) & 31, bits & 1023];
  const sign = bits & 0x8000 ? -1 : 1;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (exponent ? (1 + fraction / 1024) * 2 ** (exponent - 15) : fraction * 2 ** -24);
}

/** Texels as numbers. */
export function texels(bytes, format) {
  if (format.endsWith("16float")) return Float32Array.from(new Uint16Array(bytes), half);
  return format.endsWith("uint") ? new Uint32Array(bytes) : new Float32Array(bytes);
}
