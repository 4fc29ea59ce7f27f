// Begins quell live in this page's canvas, or says why it cannot.

import init, { start } from "./quell-live.js";

const words = document.querySelector("#words");

/** Shows words above the canvas; none: the canvas alone. */
function say(text) {
  words.textContent = text;
  words.hidden = text === "";
}

/** Why there is no WebGPU, in words; null where there is. */
async function missing() {
  if (!window.isSecureContext) {
    return "Browsers give WebGPU to pages from https and from localhost only.";
  }
  if (!navigator.gpu) {
    return "This browser has no WebGPU, which quell live needs.\n" +
      "Chrome and Edge have it from 113 on, Firefox from 141, Safari from 26; on Linux it may have to be switched on.";
  }
  if (!await navigator.gpu.requestAdapter()) {
    return "This browser has WebGPU, but finds no graphics device for it.\n" +
      "Its settings may have switched hardware acceleration off; chrome://gpu and about:support say more.";
  }
  return null;
}

// What goes wrong later: a fault of this program.
addEventListener("error", (event) => say(`quell live has failed: ${event.message}\nReload the page to begin anew.`));

try {
  const why = await missing();
  if (why) {
    say(why);
  } else {
    say("Loading.");
    await init();
    say("Compiling kernels.");
    // For scripts of this page: open(scene), report(), stop().
    window.quell = await start(document.querySelector("canvas"), location.search, say);
  }
} catch (error) {
  say(`quell live cannot begin: ${error.message ?? error}`);
}
