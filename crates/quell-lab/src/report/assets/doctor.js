"use strict";
// Each figure shows one of its pictures, flips between the first two, or wipes between them.
for (const figure of document.querySelectorAll("figure.flip")) {
  const stage = figure.querySelector(".stage");
  const pictures = [...stage.querySelectorAll("img")];
  const buttons = figure.querySelector(".buttons");
  const line = document.createElement("span");
  line.className = "line";
  line.hidden = true;
  stage.append(line);
  let timer = 0;
  let wiping = false;
  const show = (index) => {
    stage.classList.add("one");
    pictures.forEach((picture, i) => {
      picture.classList.toggle("on", i === index);
      picture.style.clipPath = "";
    });
  };
  const wipe = (share) => {
    line.style.left = `${share * 100}%`;
    pictures.forEach((picture, i) => picture.classList.toggle("on", i < 2));
    pictures[1].style.clipPath = `inset(0 0 0 ${share * 100}%)`;
  };
  const choose = (button, start) => {
    clearInterval(timer);
    wiping = false;
    line.hidden = true;
    for (const other of buttons.children) other.setAttribute("aria-pressed", String(other === button));
    start();
  };
  const add = (text, start) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = text;
    button.addEventListener("click", () => choose(button, start));
    buttons.append(button);
    return button;
  };
  let at = 0;
  const flip = add("flip", () => {
    show(0);
    timer = setInterval(() => { at = 1 - at; show(at); }, 500);
  });
  add("wipe", () => { wiping = true; line.hidden = false; stage.classList.add("one"); wipe(0.5); });
  pictures.forEach((picture, i) => add(picture.dataset.label, () => show(i)));
  stage.addEventListener("pointermove", (event) => {
    if (!wiping) return;
    const box = stage.getBoundingClientRect();
    wipe(Math.min(1, Math.max(0, (event.clientX - box.left) / box.width)));
  });
  const calm = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const wipeButton = buttons.children[1];
  // Without motion: a wipe that stands.
  (calm ? wipeButton : flip).click();
}
