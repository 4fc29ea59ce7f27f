// quell for JavaScript: the real-time denoiser on a host's own GPUDevice. Types and what each member means: index.d.ts.

export { multiplied } from "./camera.js";
export { CONVENTIONS } from "./convention.js";
export { Denoiser } from "./denoiser.js";
export { QuellError } from "./error.js";
export { loadProgram } from "./program.js";
